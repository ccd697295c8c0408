// Messages between the daemon and its other processes: lines of JSON, {"NAME": value}, where NAME
// is the kind of the message. For sources that know the messages' fields.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "proto/error.h"
#include "proto/json_values.h"

namespace isomesh::process {

[[noreturn]] inline void throw_malformed() {
  throw Error(ErrorCode::kInternal, "A message between processes is malformed.");
}

template <class T>
std::string line_of(const char* name, const T& value) {
  return json_values::object(name, value) + '\n';
}

inline std::string line_of(const char* name, const Error& error) {
  Problem problem = to_problem(error, "");
  problem.detail = error.what();  // only clients must not see that of an internal error
  return line_of(name, problem);
}

// A received line. Its sender reads untrusted bytes and may be compromised, so each value must have
// the form and the range of its type.
class ReadLine {
 public:
  // Throws Error kInternal if the line is not an object.
  explicit ReadLine(std::string_view line) {
    or_malformed([&] {
      tree_ = JsonTree(line);
      json_values::check_object(tree_.root());
    });
  }

  // Empty if the line is another message. Throws Error kInternal if the value is not a T.
  template <class T>
  std::optional<T> find(const char* name) const {
    const Json* found = json_values::find(tree_.root(), name);
    if (found == nullptr) return std::nullopt;
    std::optional<T> value(std::in_place);
    or_malformed([&] { json_values::read(*found, *value); });
    return value;
  }

 private:
  template <class Read>
  static void or_malformed(const Read& read) {
    try {
      read();
    } catch (const Error& error) {
      throw error.with_detail(std::string("A message between processes is malformed: it ") +
                              error.what() + '.');
    }
  }

  JsonTree tree_;
};

}  // namespace isomesh::process
