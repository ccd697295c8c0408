// The parts of openapi.yaml that follow from the table of parameters.
#pragma once

#include <string>

namespace isomesh {

// The description with its made parts as the table (parameters.h) has them now: each lies between
// two comments, `made of parameters.h: PART` and `end of PART`. Throws std::runtime_error when a
// part or its end is not there.
std::string with_parameters(const std::string& description);

}  // namespace isomesh
