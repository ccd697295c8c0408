#pragma once

namespace isomesh::store {

// Whether an operator takes responsibility for what looks wrong.
struct OperatorsWord {
  bool adopt = false;        // the database and the blobs belong together
  bool trust_clock = false;  // the clock is right
};

}  // namespace isomesh::store
