// Fewer random cases where each costs many times as much.
#pragma once

namespace isomesh::test {

// The step of loops over patterns and seeds. A sanitizer looks at each access of memory, which
// takes it ten times as long, and finds nothing in the thousandth case that it has not seen in the
// hundredth; the release build runs every one. Seven shares no factor with the strides of patterns,
// so every kind of them is still met.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr unsigned kStep = 7;
#else
inline constexpr unsigned kStep = 1;
#endif

}  // namespace isomesh::test
