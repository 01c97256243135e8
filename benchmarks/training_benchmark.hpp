#pragma once

#include <string>

namespace gslts::benchmarks {

/// Registers the pieces of a training step, each by itself and together, and lifting.
void add_training_benchmarks(const std::string& folder);

}  // namespace gslts::benchmarks
