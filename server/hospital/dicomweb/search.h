// All results of a QIDO-RS search, whatever the PACS makes of `limit` and `offset`.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "server/import/message/import_message.h"

namespace isomesh::dicomweb {

using import::PeersObject;

// A response to one request of a search.
struct SearchPage {
  std::vector<PeersObject> objects = {};
  bool is_not_found = false;                // status 404
  std::optional<std::string> refusal = {};  // status 400 or 422: the beginning of its text
  bool has_more = false;                    // a Warning header says that there are more results
};

struct SearchQuery {
  std::string target;                      // with a query
  std::string PeersObject::*uid;           // the member that identifies a result
  std::optional<std::string> only = {};    // the search ends when this one is found
  std::optional<std::size_t> enough = {};  // the search ends when so many are found
};

struct SearchResults {
  std::vector<PeersObject> objects = {};  // each once
  bool is_not_found = false;              // status 404: nothing found, or no such service
  bool is_cut = false;                    // the PACS has more results, but does not return them
};

// Returns the page of a target to which `limit` and `offset` may have been appended. Throws if the
// response has any other status than those of SearchPage and success.
using FetchPage = std::function<SearchPage(const std::string& target)>;

// Throws orders::PacsFailure kUnreadable if results have no UIDs, kRefused if the PACS rejects the
// search with every limit; Error kTooLarge beyond 100 000 results; and as `fetch`.
SearchResults search_all(const SearchQuery& query, const FetchPage& fetch);

// The largest number below `limit` in a refusal that is about the limit; empty if there is none.
std::optional<std::size_t> limit_named_in(const std::string& refusal, std::size_t limit);

}  // namespace isomesh::dicomweb
