#pragma once

#include <cstddef>
#include <functional>

namespace gslts::parallel {

/// Calls `task(index)` once for every index in [0, count), from up to `threads` threads.
///
/// Which thread runs an index, and when, is unspecified: a result is the same for every thread
/// count when task(i) writes only what belongs to i. The calling thread takes part. The workers
/// live in one pool for the whole process, start at the first call that needs them, sleep when
/// idle, and start anew in a forked child. Concurrent calls take turns; a call from inside a task
/// runs on the calling thread alone.
///
/// @param threads  1 runs everything in the caller; 0 means one per hardware thread.
/// @throws std::invalid_argument  if threads is negative; otherwise the first exception, by index
///   order of those caught, that a task threw, after all running tasks have ended.
void parallel_for(std::size_t count, int threads, const std::function<void(std::size_t)>& task);

/// Resolves a `threads` argument: itself, or the number of hardware threads for 0.
/// @throws std::invalid_argument  if threads is negative.
int resolve_threads(int threads);

}  // namespace gslts::parallel
