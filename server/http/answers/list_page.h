// Lists, some rows at a time.
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

// What of which list a client asks for. `Row` has a to_json of its own and of its vectors.
template <class Row>
struct ListRequest {
  std::string kind;       // of the list's cursors
  std::string after;      // the place behind which the first row is; empty: the list's beginning
  std::size_t limit = 0;  // of rows, at least 1
  // The rows behind that place, at most so many.
  std::function<std::vector<Row>(const std::string& after, std::size_t count)> read;
  std::function<std::string(const Row& row)> place_of;
};

// One page of a list as JSON, in pieces of some rows, so that others have their turns in between
// and that few rows are in memory. What is added to the list meanwhile may be in it or not. Not
// thread safe.
template <class Row>
class ListPage {
 public:
  // So many rows make a piece: a page of the usual length is one.
  static constexpr std::size_t kRowsPerPiece = 100;

  explicit ListPage(ListRequest<Row> list) : list_(std::move(list)) {}

  // The next bytes; nothing at the end. Throws what reading rows does.
  std::optional<std::string> next() {
    if (is_over_) return std::nullopt;
    // One row more than are written tells whether there are more.
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

  // Whether the last piece was the last one.
  bool is_over() const { return is_over_; }

 private:
  static constexpr const char* kNoRows = "[]";

  // An empty page, whose rows would stand within the brackets.
  static std::string opening() {
    const std::string empty = to_json(std::vector<Row>());
    return empty.substr(0, empty.find(kNoRows) + 1);
  }
  std::string closing(bool has_more) const {
    const std::string next = has_more ? cursor_after(list_.kind, list_.after) : "";
    const std::string empty = to_json(std::vector<Row>(), next);
    return empty.substr(empty.find(kNoRows) + 1);
  }

  ListRequest<Row> list_;  // what is left of it
  const char* separator_ = "";
  bool has_begun_ = false;
  bool is_over_ = false;
};

}  // namespace isomesh::http
