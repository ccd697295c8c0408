#pragma once

#include <cstddef>
#include <cstdlib>
#include <memory>
#include <new>
#include <span>
#include <type_traits>

#include <sys/mman.h>

namespace isomesh::mesh {

struct FreeMemory {
  void operator()(void* block) const { std::free(block); }
};

template <class T>
using LargeArray = std::unique_ptr<T[], FreeMemory>;

inline constexpr std::size_t kHugePage = std::size_t{2} << 20;
inline constexpr std::size_t kCacheLine = 64;

// A block of memory for so many bytes: whole cache lines, or whole huge pages.
constexpr std::size_t block_bytes(std::size_t bytes) {
  const std::size_t unit = bytes >= kHugePage ? kHugePage : kCacheLine;
  return (bytes + unit - 1) / unit * unit;
}

// Indeterminate elements, aligned to a cache line at least. Large arrays ask for huge pages: their
// first pages cost a third of what small ones do, and walks in no order that a translation buffer
// could follow are faster ever after. Throws std::bad_alloc.
template <class T>
LargeArray<T> allocate_for_overwrite(std::size_t count) {
  static_assert(std::is_trivially_destructible_v<T>);
  const std::size_t rounded = block_bytes(count * sizeof(T));
  const std::size_t unit = rounded >= kHugePage ? kHugePage : kCacheLine;
  LargeArray<T> array(static_cast<T*>(std::aligned_alloc(unit, rounded)));
  if (!array) throw std::bad_alloc();
  // Only a wish: without huge pages everything works, more slowly.
  if (unit == kHugePage) ::madvise(array.get(), rounded, MADV_HUGEPAGE);
  return array;
}

// An array that the kernels fill: its memory is neither zeroed nor copied when it grows, and it is
// kept when it shrinks, so that the next job finds pages that are mapped already. One element past
// the last may be read, though not relied on: kernels load vectors that are wider than an element.
// Not thread safe; disjoint elements may be written from several threads.
template <class T>
class Buffer {
 public:
  // Afterwards size() == count and the elements are indeterminate. Throws std::bad_alloc.
  T* resize_for_overwrite(std::size_t count) {
    if (count > capacity_) {
      data_.reset();  // give the old block back before asking for the larger one
      capacity_ = 0;
      data_ = allocate_for_overwrite<T>(count + 1);
      capacity_ = count;
    }
    size_ = count;
    if (data_) data_[count] = T{};
    return data();
  }

  // Forgets the elements from `count` on, which is at most size(); the memory is kept.
  void shrink(std::size_t count) {
    size_ = count;
    if (data_) data_[count] = T{};
  }

  std::size_t size() const { return size_; }
  std::size_t capacity_bytes() const { return capacity_ * sizeof(T); }
  T* data() { return data_.get(); }
  const T* data() const { return data_.get(); }
  T& operator[](std::size_t index) { return data_[index]; }
  const T& operator[](std::size_t index) const { return data_[index]; }
  std::span<T> span() { return {data(), size_}; }
  std::span<const T> span() const { return {data(), size_}; }
  T* begin() { return data(); }
  T* end() { return data() + size_; }
  const T* begin() const { return data(); }
  const T* end() const { return data() + size_; }

 private:
  LargeArray<T> data_;
  std::size_t size_ = 0;
  std::size_t capacity_ = 0;
};

}  // namespace isomesh::mesh
