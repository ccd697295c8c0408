// How many files and connections this process may have open.
#pragma once

#include <cstddef>

namespace isomesh::net {

// Raises the soft limit of descriptors to the hard one, which is what the system lets this process
// have, and returns it.
std::size_t raise_descriptor_limit();

// How many connections that many descriptors are enough for, of which each may need one more for
// the file that it sends or receives. Some are kept for all else: the database, the files of jobs,
// imports, callbacks, and connections that
// are refused (SenderLimits::most_parting).
std::size_t connections_within(std::size_t descriptors);

}  // namespace isomesh::net
