#pragma once

namespace isomesh::store {

// Accepts findings that otherwise stop the daemon at its start.
struct OperatorOverrides {
  bool adopt = false;        // accept that the database and the blobs belong together
  bool trust_clock = false;  // accept that the clock is right
};

}  // namespace isomesh::store
