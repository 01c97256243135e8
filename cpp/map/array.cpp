#include "gslts/map/array.hpp"

#include <cstdint>
#include <mutex>
#include <vector>

#ifdef __linux__
#include <pthread.h>
#include <sys/mman.h>
#endif

#if defined(__has_feature)
#define GSLTS_HAS_ADDRESS_SANITIZER __has_feature(address_sanitizer)
#else
#define GSLTS_HAS_ADDRESS_SANITIZER 0
#endif

namespace gslts {
namespace {

/// Alignment of small and of large blocks, bytes: those of x86-64 and of most 64-bit ARM.
constexpr std::size_t kCacheLine = 64, kHugePage = std::size_t{2} << 20;

/// Smaller blocks are left to the system's allocator, which recycles them well.
constexpr std::size_t kMinRecycledBytes = std::size_t{64} << 10;

// GCC defines the first, Clang the second.
#if defined(__SANITIZE_ADDRESS__) || GSLTS_HAS_ADDRESS_SANITIZER
constexpr std::size_t kMaxIdleBytes = 0;  // A recycled block would hide the use of a freed one.
#else
/// Maximum size of the blocks that are kept for later: the buffers of some frames.
constexpr std::size_t kMaxIdleBytes = std::size_t{128} << 20;
#endif

/// Blocks come in sizes at most an eighth apart, so that arrays of nearly the same length can
/// follow each other in one block, and from two huge pages on in whole ones.
std::size_t block_size(std::size_t bytes) {
  std::size_t step = kCacheLine;
  while (step * 16 <= bytes) step *= 2;
  if (bytes >= 2 * kHugePage && step < kHugePage) step = kHugePage;
  return (bytes + step - 1) / step * step;
}

std::align_val_t alignment(std::size_t size) {
  return std::align_val_t{size >= 2 * kHugePage ? kHugePage : kCacheLine};
}

struct Block {
  void* pointer;
  std::size_t size;
};

/// The released blocks, oldest first.
struct IdleBlocks {
  std::mutex mutex;
  std::vector<Block> blocks;
  std::size_t bytes = 0;

  static IdleBlocks& instance() {
    // Never destroyed: arrays may outlive any static object.
    static IdleBlocks* const idle = [] {
#ifdef __linux__
      // A child of a fork must not inherit the lock of a thread that it does not have.
      pthread_atfork([] { instance().mutex.lock(); }, [] { instance().mutex.unlock(); },
                     [] { instance().mutex.unlock(); });
#endif
      return new IdleBlocks;
    }();
    return *idle;
  }
};

void free_block(const Block& block) { ::operator delete(block.pointer, alignment(block.size)); }

}  // namespace

void* allocate_array(std::size_t bytes) {
  if (bytes < kMinRecycledBytes) return ::operator new (bytes, std::align_val_t{kCacheLine});
  if (bytes > PTRDIFF_MAX) throw std::bad_alloc();
  const std::size_t size = block_size(bytes);
  {
    IdleBlocks& idle = IdleBlocks::instance();
    const std::lock_guard<std::mutex> lock(idle.mutex);
    for (auto block = idle.blocks.end(); block != idle.blocks.begin();) {
      --block;
      if (block->size != size) continue;
      void* const pointer = block->pointer;
      idle.bytes -= size;
      idle.blocks.erase(block);
      return pointer;
    }
  }
  void* const pointer = ::operator new(size, alignment(size));
#ifdef __linux__
  // It is advice: a refusal changes nothing but the speed.
  if (size >= 2 * kHugePage) madvise(pointer, size, MADV_HUGEPAGE);
#endif
  return pointer;
}

void deallocate_array(void* pointer, std::size_t bytes) noexcept {
  if (bytes < kMinRecycledBytes) {
    ::operator delete (pointer, std::align_val_t{kCacheLine});
    return;
  }
  const Block block{pointer, block_size(bytes)};
  if (block.size > kMaxIdleBytes) {
    free_block(block);
    return;
  }
  IdleBlocks& idle = IdleBlocks::instance();
  const std::lock_guard<std::mutex> lock(idle.mutex);
  auto oldest = idle.blocks.begin();
  while (idle.bytes + block.size > kMaxIdleBytes) {
    idle.bytes -= oldest->size;
    free_block(*oldest++);
  }
  idle.blocks.erase(idle.blocks.begin(), oldest);
  try {
    idle.blocks.push_back(block);
    idle.bytes += block.size;
  } catch (const std::bad_alloc&) {
    free_block(block);
  }
}

}  // namespace gslts
