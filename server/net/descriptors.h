#pragma once

#include <cstddef>

namespace isomesh::net {

// A daemon needs at least this many: about 40 for itself, 64 for connections_within() of them and
// their files, and the rest for its processes.
inline constexpr std::size_t kFewestDescriptors = 128;

// Raises the soft limit of descriptors to the hard limit, and returns it. Throws Error kUnavailable
// if it is below kFewestDescriptors.
std::size_t raise_descriptor_limit();

// The number of connections that the descriptors suffice for; each may also need one for the file
// that it sends or receives. Reserves some for the database, the files of jobs, imports, callbacks,
// and rejected connections (SenderLimits::most_parting).
std::size_t connections_within(std::size_t descriptors);

}  // namespace isomesh::net
