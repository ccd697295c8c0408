// The parts of openapi.yaml generated from the tables of proto.
#pragma once

#include <string>

namespace isomesh {

// Returns the description with its generated parts rebuilt from the tables.
// Each part lies between two comments, such as `made of parameters.h: PART` and `end of PART`.
// Throws std::runtime_error if a part or its end is missing.
std::string with_parameters(const std::string& description);

}  // namespace isomesh
