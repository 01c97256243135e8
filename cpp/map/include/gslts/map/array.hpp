#pragma once

#include <cstddef>
#include <memory>
#include <new>
#include <utility>
#include <vector>

namespace gslts {

/// Allocator behind `Array`: cache-line aligned, and `resize` leaves numbers uninitialised, because
/// images and gradients of many megabytes are written once and must not be zeroed first.
template <typename T>
struct UninitializedAllocator {
  using value_type = T;
  static constexpr std::align_val_t kAlignment{64};

  UninitializedAllocator() = default;
  template <typename U>
  UninitializedAllocator(const UninitializedAllocator<U>&) {}

  T* allocate(std::size_t n) { return static_cast<T*>(::operator new(n * sizeof(T), kAlignment)); }
  void deallocate(T* pointer, std::size_t) { ::operator delete(pointer, kAlignment); }

  template <typename U>
  void construct(U* pointer) {
    ::new (static_cast<void*>(pointer)) U;
  }
  template <typename U, typename... Args>
  void construct(U* pointer, Args&&... args) {
    ::new (static_cast<void*>(pointer)) U(std::forward<Args>(args)...);
  }

  friend bool operator==(const UninitializedAllocator&, const UninitializedAllocator&) {
    return true;
  }
  friend bool operator!=(const UninitializedAllocator&, const UninitializedAllocator&) {
    return false;
  }
};

/// A `std::vector` whose `Array<T>(n)` and `resize(n)` leave trivial elements uninitialised.
template <typename T>
using Array = std::vector<T, UninitializedAllocator<T>>;

}  // namespace gslts
