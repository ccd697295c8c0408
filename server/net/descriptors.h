#pragma once

#include <cstddef>

namespace isomesh::net {

// Raises the soft limit of descriptors to the hard limit, and returns it.
std::size_t raise_descriptor_limit();

// The number of connections that the descriptors suffice for; each may also need one for the file
// that it sends or receives. Reserves some for the database, the files of jobs, imports, callbacks,
// and rejected connections (SenderLimits::most_parting).
std::size_t connections_within(std::size_t descriptors);

}  // namespace isomesh::net
