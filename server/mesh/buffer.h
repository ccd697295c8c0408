#pragma once

#include <cstddef>
#include <span>

#include "server/mesh/large_memory.h"

namespace isomesh::mesh {

// An array that the kernels fill: its memory is neither zeroed nor copied when it grows, and it is
// kept when it shrinks, so that the next job finds pages that are mapped already. One element past
// the last may be read, though not relied on: kernels load vectors that are wider than an element.
// Not thread safe; disjoint elements may be written from several threads.
template <class T>
class Buffer {
 public:
  // Afterwards size() == count and the elements are indeterminate.
  void resize_for_overwrite(std::size_t count) {
    if (count > capacity_) {
      data_.reset();  // give the old block back before asking for the larger one
      capacity_ = 0;
      data_ = allocate_for_overwrite<T>(count + 1);
      capacity_ = count;
    }
    size_ = count;
    if (data_) data_[count] = T{};
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
