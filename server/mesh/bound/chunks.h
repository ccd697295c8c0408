// Loops over long arrays on several threads; private to this folder.
#pragma once

#include <algorithm>
#include <cstddef>

#include "server/mesh/parallel.h"

namespace isomesh::mesh::bound {

inline constexpr std::size_t kChunk = 1 << 14;

inline std::size_t chunks_of(std::size_t count) { return (count + kChunk - 1) / kChunk; }

// Calls body(begin, end, chunk) for each of the chunks of [0, count).
template <class Body>
void for_chunks(const Context& context, std::size_t count, Body body) {
  parallel_for(context, chunks_of(count), [&](std::size_t chunk) {
    body(chunk * kChunk, std::min(count, (chunk + 1) * kChunk), chunk);
  });
}

// Calls body(i) for each number in [0, count).
template <class Body>
void for_each(const Context& context, std::size_t count, Body body) {
  for_chunks(context, count, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t i = begin; i < end; ++i) body(i);
  });
}

}  // namespace isomesh::mesh::bound
