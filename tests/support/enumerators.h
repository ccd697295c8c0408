#pragma once

#include <string>
#include <vector>

#include "proto/types.h"

namespace isomesh::test {

// All names of an enumeration with consecutive values, in order.
template <class Enum>
std::vector<std::string> names() {
  std::vector<std::string> all;
  for (int number = 0; !to_string(Enum{number}).empty(); ++number) {
    all.emplace_back(to_string(Enum{number}));
  }
  return all;
}

}  // namespace isomesh::test
