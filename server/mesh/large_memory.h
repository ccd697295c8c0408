// Memory for arrays that kernels fill.
#pragma once

#include <cstddef>
#include <cstdlib>
#include <memory>
#include <new>
#include <type_traits>

#include <sys/mman.h>

namespace isomesh::mesh {

struct FreeMemory {
  void operator()(void* block) const { std::free(block); }
};

template <class T>
using LargeArray = std::unique_ptr<T[], FreeMemory>;

// Indeterminate elements, aligned to a cache line at least. Large arrays ask for huge pages: their
// first pages cost a third of what small ones do, and walks in no order that a translation buffer
// could follow are faster ever after. Throws std::bad_alloc.
template <class T>
LargeArray<T> allocate_for_overwrite(std::size_t count) {
  static_assert(std::is_trivially_destructible_v<T>);
  constexpr std::size_t kHugePage = std::size_t{2} << 20;
  constexpr std::size_t kCacheLine = 64;
  const std::size_t bytes = count * sizeof(T);
  const std::size_t unit = bytes >= kHugePage ? kHugePage : kCacheLine;
  const std::size_t rounded = (bytes + unit - 1) / unit * unit;
  LargeArray<T> array(static_cast<T*>(std::aligned_alloc(unit, rounded)));
  if (!array) throw std::bad_alloc();
  // Only a wish: without huge pages everything works, more slowly.
  if (unit == kHugePage) ::madvise(array.get(), rounded, MADV_HUGEPAGE);
  return array;
}

}  // namespace isomesh::mesh
