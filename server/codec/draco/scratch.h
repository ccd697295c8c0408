// Memory that a stage fills and keeps from mesh to mesh; private to this folder.
#pragma once

#include <cstddef>

#include "server/mesh/large_memory.h"

namespace isomesh::codec::edgebreaker {

// An array whose elements are indeterminate until they are written. Not thread
// safe; disjoint elements may be written from several threads.
template <class T>
class Scratch {
 public:
  // At least `count` elements, indeterminate if they are more than there were. Throws
  // std::bad_alloc.
  T* reserve(std::size_t count) {
    if (count <= capacity_) return data_.get();
    capacity_ = 0;
    data_.reset();  // give the old block back before asking for the larger one
    data_ = mesh::allocate_for_overwrite<T>(count);
    capacity_ = count;
    return data_.get();
  }

  T* data() { return data_.get(); }
  const T* data() const { return data_.get(); }
  T& operator[](std::size_t index) { return data_[index]; }
  const T& operator[](std::size_t index) const { return data_[index]; }

 private:
  mesh::LargeArray<T> data_;
  std::size_t capacity_ = 0;
};

}  // namespace isomesh::codec::edgebreaker
