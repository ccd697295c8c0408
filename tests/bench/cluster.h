// Several daemons on one PostgreSQL and one folder of blobs, all on this machine.
#pragma once

#include <filesystem>
#include <vector>

#include "tests/bench/findings.h"

namespace isomesh::bench {

// Starts a PostgreSQL that brings to the disk what it has said to have, and daemons of one worker
// and one thread each. Throws std::runtime_error where PostgreSQL is not installed or something
// does not start, and what stores and the client library throw.
std::vector<Finding> measure_cluster(const std::filesystem::path& daemon);

}  // namespace isomesh::bench
