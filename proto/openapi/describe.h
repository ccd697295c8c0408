// The parts of openapi.yaml that follow from the tables of parameters and notes.
#pragma once

#include <string>

namespace isomesh {

// The description with its made parts as the tables (parameters.h, notes.h) have them now: each
// lies between two comments, such as `made of parameters.h: PART` and `end of PART`. Throws
// std::runtime_error when a part or its end is not there.
std::string with_parameters(const std::string& description);

}  // namespace isomesh
