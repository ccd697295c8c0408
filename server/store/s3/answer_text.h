// What S3 answers in XML.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace isomesh::store {

// The name of the outermost element, and all elements that hold nothing but text.
struct S3Text {
  struct Leaf {
    std::string parent;
    std::string name;
    std::string text;
  };

  std::string root;
  std::vector<Leaf> leaves;

  // The text of the first of that name, in any place; empty without one.
  std::string_view find(std::string_view name) const;
};

// Empty for what is no XML, or is cut off.
S3Text read_s3_text(std::string_view body);

// The code of an error that was answered, as it may stand in a log; empty where there is none.
std::string s3_error_code(std::string_view body);

}  // namespace isomesh::store
