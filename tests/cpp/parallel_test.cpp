#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <mutex>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

#include "gslts/parallel/parallel_for.hpp"

namespace gslts::parallel {
namespace {

using testing::AllOf;
using testing::Each;
using testing::HasSubstr;
using testing::ThrowsMessage;

std::vector<int> runs_per_index(std::size_t count, int threads) {
  std::vector<std::atomic<int>> runs(count);
  parallel_for(count, threads, [&](std::size_t i) { ++runs[i]; });
  return {runs.begin(), runs.end()};
}

class ParallelFor : public testing::TestWithParam<std::tuple<std::size_t, int>> {};

TEST_P(ParallelFor, RunsEveryIndexOnce) {
  const auto [count, threads] = GetParam();
  for (int repeat = 0; repeat < 20; ++repeat) {
    ASSERT_THAT(runs_per_index(count, threads), Each(1));
  }
}

INSTANTIATE_TEST_SUITE_P(CountsAndThreads, ParallelFor,
                         testing::Combine(testing::Values(0, 1, 2, 3, 7, 1000),
                                          testing::Values(0, 1, 2, 3, 8)));

TEST(Parallel, OneThreadRunsInOrderInTheCaller) {
  std::vector<std::size_t> order;
  const auto caller = std::this_thread::get_id();
  parallel_for(5, 1, [&](std::size_t i) {
    EXPECT_EQ(std::this_thread::get_id(), caller);
    order.push_back(i);
  });
  EXPECT_THAT(order, testing::ElementsAre(0, 1, 2, 3, 4));
}

TEST(Parallel, UsesAsManyThreadsAsAsked) {
  std::mutex mutex;
  std::set<std::thread::id> ids;
  std::atomic<int> waiting{0};
  // Each task waits for the others, so that four threads are needed.
  parallel_for(4, 4, [&](std::size_t) {
    ++waiting;
    while (waiting < 4) std::this_thread::yield();
    const std::lock_guard lock(mutex);
    ids.insert(std::this_thread::get_id());
  });
  EXPECT_EQ(ids.size(), 4u);
  EXPECT_EQ(ids.count(std::this_thread::get_id()), 1u);
}

TEST(Parallel, NeverUsesMoreThreadsThanAsked) {
  runs_per_index(100, 8);  // The pool now holds more workers than the next call may use.
  std::atomic<int> running{0}, most{0};
  parallel_for(200, 2, [&](std::size_t) {
    const int now = ++running;
    int before = most;
    while (now > before && !most.compare_exchange_weak(before, now)) {
    }
    std::this_thread::sleep_for(std::chrono::microseconds(50));
    --running;
  });
  EXPECT_LE(most, 2);
}

TEST(Parallel, NegativeThreadsAreRefused) {
  EXPECT_THAT([] { parallel_for(3, -2, [](std::size_t) {}); },
              ThrowsMessage<std::invalid_argument>(
                  AllOf(HasSubstr("parallel_for"), HasSubstr("threads"), HasSubstr("-2"))));
  EXPECT_THAT([] { resolve_threads(-1); },
              ThrowsMessage<std::invalid_argument>(
                  AllOf(HasSubstr("resolve_threads"), HasSubstr("threads"), HasSubstr("-1"))));
}

TEST(Parallel, ResolveThreads) {
  EXPECT_EQ(resolve_threads(3), 3);
  EXPECT_GE(resolve_threads(0), 1);
}

class ParallelThreads : public testing::TestWithParam<int> {};

TEST_P(ParallelThreads, ExceptionStopsTheRestAndReachesTheCaller) {
  const int threads = GetParam();
  std::atomic<int> started{0};
  const auto call = [&] {
    parallel_for(5000, threads, [&](std::size_t i) {
      ++started;
      if (i == 5) throw std::runtime_error("index " + std::to_string(i));
      // Long enough that the others cannot finish while the exception travels.
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    });
  };
  EXPECT_THAT(call, ThrowsMessage<std::runtime_error>("index 5"));
  EXPECT_LT(started, 5000);
  EXPECT_THAT(runs_per_index(100, threads), Each(1));
}

TEST_P(ParallelThreads, LowestOfTheExceptionsWins) {
  const int threads = GetParam();
  std::atomic<int> waiting{0};
  // The indices that run at once all throw, and 0 is the last to do so.
  const auto call = [&] {
    parallel_for(threads, threads, [&](std::size_t i) {
      ++waiting;
      while (threads > 1 && waiting < threads) std::this_thread::yield();
      if (i == 0) std::this_thread::sleep_for(std::chrono::milliseconds(2));
      throw std::runtime_error("index " + std::to_string(i));
    });
  };
  EXPECT_THAT(call, ThrowsMessage<std::runtime_error>("index 0"));
}

TEST_P(ParallelThreads, CallFromATaskStaysOnItsThread) {
  const int threads = GetParam();
  std::atomic<int> runs{0};
  parallel_for(8, threads, [&](std::size_t) {
    const auto outer = std::this_thread::get_id();
    parallel_for(8, 4, [&](std::size_t) {
      EXPECT_EQ(std::this_thread::get_id(), outer);
      ++runs;
    });
  });
  EXPECT_EQ(runs, 64);
}

INSTANTIATE_TEST_SUITE_P(Threads, ParallelThreads, testing::Values(1, 2, 4));

TEST(Parallel, NestedExceptionReachesTheOuterCaller) {
  const auto call = [] {
    parallel_for(4, 4, [](std::size_t) {
      parallel_for(4, 4, [](std::size_t) { throw std::runtime_error("inner"); });
    });
  };
  EXPECT_THAT(call, ThrowsMessage<std::runtime_error>("inner"));
}

TEST(Parallel, ConcurrentCallersAllGetTheirWork) {
  std::vector<std::thread> callers;
  std::atomic<int> correct{0};
  for (int caller = 0; caller < 4; ++caller) {
    callers.emplace_back([&, caller] {
      for (int repeat = 0; repeat < 50; ++repeat) {
        const auto runs = runs_per_index(64, 1 + caller);
        correct += std::all_of(runs.begin(), runs.end(), [](int n) { return n == 1; });
      }
    });
  }
  for (std::thread& caller : callers) caller.join();
  EXPECT_EQ(correct, 200);
}

#if defined(__SANITIZE_THREAD__)
constexpr bool kForkWithThreadsWorks = false;  // ThreadSanitizer does not support it.
#else
constexpr bool kForkWithThreadsWorks = true;
#endif

/// Exit status of a forked child that runs parallel_for; a child that hangs dies by SIGALRM.
int status_of_forked_child() {
  const pid_t child = fork();
  if (child == 0) {
    alarm(20);
    const std::vector<int> runs = runs_per_index(1000, 4);
    _exit(std::all_of(runs.begin(), runs.end(), [](int n) { return n == 1; }) ? 0 : 1);
  }
  int status = -1;
  waitpid(child, &status, 0);
  return status;
}

TEST(ParallelFork, ChildStartsItsOwnWorkers) {
  if (!kForkWithThreadsWorks) GTEST_SKIP();
  runs_per_index(1000, 4);
  EXPECT_EQ(status_of_forked_child(), 0);
  EXPECT_THAT(runs_per_index(1000, 4), Each(1));
}

TEST(ParallelFork, ChildWorksWhenForkedDuringAnothersCall) {
  if (!kForkWithThreadsWorks) GTEST_SKIP();
  std::atomic<bool> stop{false};
  std::thread caller([&] {
    while (!stop) parallel_for(64, 4, [](std::size_t) {});
  });
  for (int repeat = 0; repeat < 20; ++repeat) EXPECT_EQ(status_of_forked_child(), 0);
  stop = true;
  caller.join();
}

}  // namespace
}  // namespace gslts::parallel
