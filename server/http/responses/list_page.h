// Pages of lists, written a few rows at a time.
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "proto/json.h"
#include "server/http/requests/request_values.h"

namespace isomesh::http {

// The part of a list that a client requests. `Row` and vectors of it have a to_json.
template <class Row>
struct ListRequest {
  std::string kind;       // in the list's cursors
  std::string after;      // the place before the first row; empty: the list's beginning
  std::size_t limit = 0;  // maximum number of rows, at least 1
  // Returns at most `count` rows after that place.
  std::function<std::vector<Row>(const std::string& after, std::size_t count)> read;
  std::function<std::string(const Row& row)> place_of;
};

// One page of a list as JSON, in pieces of a few rows, so that other requests are served in between
// and memory stays small. Concurrent additions may or may not appear. Not thread safe.
template <class Row>
class ListPage {
 public:
  // A page of the default length is one piece.
  static constexpr std::size_t kRowsPerPiece = 100;

  explicit ListPage(ListRequest<Row> list) : list_(std::move(list)) {}

  // Returns the next bytes; empty at the end. Throws as reading rows does.
  std::optional<std::string> next() {
    if (is_over_) return std::nullopt;
    // One extra row tells whether more follow.
    const std::size_t count = std::min(list_.limit, kRowsPerPiece);
    std::vector<Row> rows = list_.read(list_.after, count + 1);
    const bool has_more = rows.size() > count;
    if (has_more) rows.pop_back();
    if (!rows.empty()) list_.after = list_.place_of(rows.back());
    list_.limit -= rows.size();
    std::string text = has_begun_ ? "" : opening();
    for (const Row& row : rows) text.append(std::exchange(separator_, ",")).append(to_json(row));
    has_begun_ = true;
    is_over_ = !has_more || list_.limit == 0;
    if (is_over_) text += closing(has_more);
    return text;
  }

  bool is_over() const { return is_over_; }

 private:
  static constexpr const char* kNoRows = "[]";

  // An empty page up to the opening bracket of its rows.
  static std::string opening() {
    const std::string empty = to_json(std::vector<Row>());
    return empty.substr(0, empty.find(kNoRows) + 1);
  }
  std::string closing(bool has_more) const {
    const std::string next = has_more ? cursor_after(list_.kind, list_.after) : "";
    const std::string empty = to_json(std::vector<Row>(), next);
    return empty.substr(empty.find(kNoRows) + 1);
  }

  ListRequest<Row> list_;  // the remaining part
  const char* separator_ = "";
  bool has_begun_ = false;
  bool is_over_ = false;
};

}  // namespace isomesh::http
