// Memory that a stage fills and keeps from mesh to mesh; private to this folder.
#pragma once

#include <cstddef>
#include <cstdlib>
#include <memory>
#include <new>

#include <sys/mman.h>

namespace isomesh::codec::edgebreaker {

// An array whose elements are indeterminate until they are written. Large ones ask for huge pages:
// walks over a surface touch all of it in no order that a translation buffer could follow. Not
// thread safe; disjoint elements may be written from several threads.
template <class T>
class Scratch {
 public:
  // At least `count` elements, indeterminate if they are more than there were. Throws
  // std::bad_alloc.
  T* reserve(std::size_t count) {
    if (count <= capacity_) return data_.get();
    constexpr std::size_t kHugePage = std::size_t{2} << 20;
    constexpr std::size_t kCacheLine = 64;
    const std::size_t bytes = count * sizeof(T);
    const std::size_t unit = bytes >= kHugePage ? kHugePage : kCacheLine;
    const std::size_t rounded = (bytes + unit - 1) / unit * unit;
    capacity_ = 0;
    data_.reset();  // give the old block back before asking for the larger one
    data_.reset(static_cast<T*>(std::aligned_alloc(unit, rounded)));
    if (!data_) throw std::bad_alloc();
    // Only a wish: without huge pages everything works, more slowly.
    if (unit == kHugePage) ::madvise(data_.get(), rounded, MADV_HUGEPAGE);
    capacity_ = count;
    return data_.get();
  }

  T* data() { return data_.get(); }
  const T* data() const { return data_.get(); }
  T& operator[](std::size_t index) { return data_[index]; }
  const T& operator[](std::size_t index) const { return data_[index]; }

 private:
  struct Free {
    void operator()(T* block) const { std::free(block); }
  };

  std::unique_ptr<T[], Free> data_;
  std::size_t capacity_ = 0;
};

}  // namespace isomesh::codec::edgebreaker
