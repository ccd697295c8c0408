// Lists that come in pages. Private to the libraries of the client.
#pragma once

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <string>

#include "proto/error.h"
#include "proto/json.h"

namespace isomesh {

// In bytes of JSON. The pages of a list could go on for ever.
inline constexpr std::uint64_t kLongestList = std::uint64_t{256} << 20;

// All items of a list: `ask` returns the body of the page of a cursor, and `parse` its items.
// Throws Error kInternal for a list that is longer than kLongestList.
template <class Ask, class Parse>
auto all_pages(const Ask& ask, const Parse& parse) {
  decltype(parse(std::string())) all;
  std::string cursor;
  std::uint64_t bytes = 0;
  do {
    const std::string body = ask(cursor);
    bytes += body.size();
    if (bytes > kLongestList) {
      throw Error(ErrorCode::kInternal, "the server's list is longer than this program reads");
    }
    auto page = parse(body);
    cursor = page.empty() ? "" : next_from_json(body);
    std::ranges::move(page, std::back_inserter(all));
  } while (!cursor.empty());
  return all;
}

}  // namespace isomesh
