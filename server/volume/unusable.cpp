#include "server/volume/unusable.h"

#include "base/error.h"

namespace isomesh::volume {

void throw_unusable(const std::string& reason) { throw Error(ErrorCode::kUnusableVolume, reason); }

}  // namespace isomesh::volume
