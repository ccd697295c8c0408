// Data sets in the DICOM JSON Model (PS3.18, F).
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

namespace isomesh::worklist {

// An object whose members are the tags, in ascending order, as upper-case hexadecimal.
using DataSet = nlohmann::json;

// Reads one data set, or a list of one. Throws Error kInvalidParameter that names the attribute for
// what is no data set, has bulk data, or is nested too deeply.
DataSet parse_data_set(std::string_view text);

// Throws Error kInvalidParameter that names the attribute whose values are of another kind than its
// vr wants, such as a number for a CS. For requests: older records may have such values.
void check_types(const DataSet& data);

// The values of an attribute; empty without the attribute or values.
const std::vector<nlohmann::json>& values_of(const DataSet& data, std::string_view tag);

// The first value if that is a text.
std::string text_of(const DataSet& data, std::string_view tag);

// An attribute with one value.
nlohmann::json attribute(std::string_view vr, nlohmann::json value);

}  // namespace isomesh::worklist
