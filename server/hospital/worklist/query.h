// A search for workitems (PS3.18, 11.9; matching: PS3.4, C.2.2.2). Pure functions.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/hospital/records/workitem_store.h"
#include "server/hospital/worklist/dicom_json.h"

namespace isomesh::worklist {

struct Query {
  // The tags from the data set to the attribute, and the value to match.
  std::vector<std::pair<std::vector<std::string>, std::string>> keys;
  std::size_t limit = 100;
  std::size_t offset = 0;
  bool wants_fuzzy = false;  // which is not supported

  // The state that the query wants, if it wants a single one.
  std::optional<store::WorkitemState> state() const;
};

inline constexpr std::size_t kMostResults = 1000;

// `parameters` are names and values. Attributes have their keyword or their tag, those within
// sequences after that of the sequence and a dot. Throws Error kInvalidParameter that names the
// parameter.
Query parse_query(const std::vector<std::pair<std::string, std::string>>& parameters);

bool matches(const Query& query, const DataSet& data);

}  // namespace isomesh::worklist
