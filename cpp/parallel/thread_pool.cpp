#include <pthread.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <exception>
#include <limits>
#include <mutex>
#include <stdexcept>
#include <string>
#include <system_error>
#include <thread>
#include <utility>

#include "gslts/parallel/parallel_for.hpp"

namespace gslts::parallel {
namespace {

/// True while this thread runs a task; a nested `parallel_for` then stays on this thread.
thread_local bool inside_task = false;

class InsideTask {
 public:
  InsideTask() : before_(std::exchange(inside_task, true)) {}
  ~InsideTask() { inside_task = before_; }
  InsideTask(const InsideTask&) = delete;
  InsideTask& operator=(const InsideTask&) = delete;

 private:
  const bool before_;
};

/// State of a call of `parallel_for`. Threads take indices until none is left.
class Job {
 public:
  Job(std::size_t count, const std::function<void(std::size_t)>& task)
      : count_(count), task_(task) {}

  void work() {
    const InsideTask guard;
    for (;;) {
      const std::size_t index = next_.fetch_add(1, std::memory_order_relaxed);
      if (index >= count_) return;
      try {
        task_(index);
      } catch (...) {
        next_.store(count_, std::memory_order_relaxed);  // Nobody starts another index.
        keep(index, std::current_exception());
      }
    }
  }

  /// Call after the last thread has left `work`.
  void rethrow() const {
    if (exception_) std::rethrow_exception(exception_);
  }

 private:
  void keep(std::size_t index, std::exception_ptr exception) {
    const std::lock_guard lock(exception_mutex_);
    if (index > exception_index_) return;
    exception_index_ = index;
    exception_ = std::move(exception);
  }

  const std::size_t count_;
  const std::function<void(std::size_t)>& task_;
  std::atomic<std::size_t> next_{0};
  std::mutex exception_mutex_;
  std::size_t exception_index_ = std::numeric_limits<std::size_t>::max();
  std::exception_ptr exception_;
};

class Pool {
 public:
  void run(Job& job, std::size_t helpers) {
    const std::lock_guard turn(turn_);
    helpers = std::min(helpers, grow(helpers));
    {
      const std::lock_guard lock(mutex_);
      job_ = &job;
      seats_ = helpers;
    }
    for (std::size_t i = 0; i < helpers; ++i) wake_.notify_one();
    job.work();
    std::unique_lock lock(mutex_);
    seats_ = 0;  // A worker that has not woken by now is not waited for.
    left_.wait(lock, [this] { return seated_ == 0; });
  }

 private:
  /// Starts workers until there are `wanted`; returns how many there are, fewer if the system
  /// starts no thread, which changes the speed only.
  std::size_t grow(std::size_t wanted) {
    try {
      for (; workers_ < wanted; ++workers_) std::thread([this] { serve(); }).detach();
    } catch (const std::system_error&) {
    }
    return workers_;
  }

  [[noreturn]] void serve() {
    std::unique_lock lock(mutex_);
    for (;;) {
      wake_.wait(lock, [this] { return seats_ > 0; });
      --seats_;
      ++seated_;
      Job& job = *job_;
      lock.unlock();
      job.work();
      lock.lock();
      if (--seated_ == 0) left_.notify_one();
    }
  }

  std::mutex turn_;          ///< Held for a whole run: callers take turns.
  std::size_t workers_ = 0;  ///< Guarded by turn_, as is nothing else.

  std::mutex mutex_;  ///< Guards all below.
  std::condition_variable wake_, left_;
  Job* job_ = nullptr;
  std::size_t seats_ = 0;   ///< Workers that may still join the job.
  std::size_t seated_ = 0;  ///< Workers that are in it.
};

// The pool is never destroyed: its workers sleep until the process ends, so no static destructor
// can run into them.
std::atomic<Pool*> process_pool{nullptr};

// A forked child has no workers, and another thread may have held the pool's mutexes at the fork:
// the child abandons that pool, and its first parallel call makes its own.
[[maybe_unused]] const int kForkHandler =
    pthread_atfork(nullptr, nullptr, [] { process_pool.store(nullptr); });

Pool& pool() {
  Pool* current = process_pool.load();
  if (current != nullptr) return *current;
  Pool* fresh = new Pool;
  if (process_pool.compare_exchange_strong(current, fresh)) return *fresh;
  delete fresh;  // Another thread was first.
  return *current;
}

int resolve(int threads, const char* function) {
  if (threads < 0) {
    throw std::invalid_argument(std::string(function) + ": threads must be 0 or more, got " +
                                std::to_string(threads));
  }
  if (threads > 0) return threads;
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

}  // namespace

void parallel_for(std::size_t count, int threads, const std::function<void(std::size_t)>& task) {
  const std::size_t team = std::min<std::size_t>(count, resolve(threads, "parallel_for"));
  Job job(count, task);
  if (team <= 1 || inside_task) {
    job.work();
  } else {
    pool().run(job, team - 1);
  }
  job.rethrow();
}

int resolve_threads(int threads) { return resolve(threads, "resolve_threads"); }

}  // namespace gslts::parallel
