// Output of isomesh-bench: tables as JSON, each an array of objects that have the same members.
#pragma once

#include <string>

#include <nlohmann/json.hpp>

namespace isomesh::bench {

using Json = nlohmann::ordered_json;

// Zero where something was not measured is null in JSON.
inline Json if_measured(double value) { return value > 0 ? Json(value) : Json(); }

// As a table for a terminal. A member's name ends in its unit, if it has one: _ms or _bytes.
std::string to_text(const Json& rows);

}  // namespace isomesh::bench
