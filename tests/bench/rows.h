// Output of isomesh-bench: tables as JSON, each an array of objects that have the same members.
#pragma once

#include <cstdint>
#include <string>

#include <nlohmann/json.hpp>

namespace isomesh::bench {

using Json = nlohmann::ordered_json;

// Zero where something was not measured is null in JSON.
inline Json if_measured(double value) { return value > 0 ? Json(value) : Json(); }

// As a table in Markdown. A member's name ends in its unit, if it has one: ms or bytes.
std::string to_markdown(const Json& rows);

std::string fixed(double value, int digits);
// "12.3 ms", or seconds if there are many.
std::string milliseconds(double ms);
std::string mebibytes(std::uint64_t bytes);

}  // namespace isomesh::bench
