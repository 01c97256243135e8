#pragma once

#include <cstdint>

namespace gslts::benchmarks {

/// Float multiply-adds on independent accumulators in registers, `rounds` times over; what no
/// kernel on this core can exceed.
/// @return  Number of float multiply-adds done (two FLOP each).
std::int64_t run_fma(std::int64_t rounds);

/// Float lanes of the widest vector that the machine has.
std::int64_t fma_lanes();

}  // namespace gslts::benchmarks
