#pragma once

namespace isomesh::store {

// Overrides that an operator gives at the start, when the daemon finds something suspicious.
struct OperatorsWord {
  bool adopt = false;        // accept that the database and the blobs belong together
  bool trust_clock = false;  // accept that the clock is right
};

}  // namespace isomesh::store
