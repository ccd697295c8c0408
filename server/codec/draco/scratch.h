// Memory that a stage keeps between meshes. Private to this folder.
#pragma once

#include <cstddef>

#include "server/mesh/large_memory.h"

namespace isomesh::codec::edgebreaker {

// An array with uninitialised elements. Not thread safe, but threads may write disjoint elements.
template <class T>
class Scratch {
 public:
  // Returns at least `count` elements, uninitialised after growth. Throws std::bad_alloc.
  T* reserve(std::size_t count) {
    if (count <= capacity_) return data_.get();
    capacity_ = 0;
    data_.reset();  // free the old block before allocating the larger one
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
