// Reads the XML of S3's responses.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace isomesh::store {

// The name of the root element, and all elements that contain only text.
struct S3Text {
  struct Leaf {
    std::string parent;
    std::string name;
    std::string text;
  };

  std::string root;
  std::vector<Leaf> leaves;

  // The text of the first element with that name, at any depth; empty if there is none.
  std::string_view find(std::string_view name) const;
};

// Empty if the body is not XML or is truncated.
S3Text read_s3_text(std::string_view body);

// The code of an S3 error, safe for a log; empty if there is none.
std::string s3_error_code(std::string_view body);

}  // namespace isomesh::store
