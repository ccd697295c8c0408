#include "server/hospital/dicomweb/search.h"

#include <algorithm>
#include <charconv>
#include <set>

#include "base/error.h"
#include "base/text.h"
#include "server/hospital/orders/pacs.h"

namespace isomesh::dicomweb {
namespace {

using orders::PacsFailure;
using orders::PacsFault;

// Every PACS of docs/hospital.md accepts this limit.
constexpr std::size_t kPage = 100;
constexpr std::size_t kMost = 100'000;

class Search {
 public:
  Search(const SearchQuery& query, const FetchPage& fetch) : query_(query), fetch_(fetch) {}

  SearchResults run() && {
    std::size_t limit = kPage;
    std::size_t offset = 0;
    while (results_.objects.size() < kMost) {
      const SearchPage page = fetch_(query_.target + "&limit=" + std::to_string(limit) +
                                     "&offset=" + std::to_string(offset));
      if (page.refusal) {
        const auto smaller =
            offset == 0 ? limit_named_in(*page.refusal, limit) : std::optional<std::size_t>();
        if (!smaller) return std::move(*this).run_without_limit();
        limit = *smaller;
        continue;
      }
      results_.is_not_found = page.is_not_found && offset == 0;
      const bool has_new = add(page.objects);
      if (page.objects.empty() || is_found()) return std::move(results_);
      if (!has_new) {
        // The PACS ignores the offset. If it ignores the limit too, the page has all results.
        if (page.objects.size() == limit) return std::move(*this).run_without_limit();
        results_.is_cut = page.has_more;
        return std::move(results_);
      }
      // A PACS may return fewer results than the limit although it has more, so only a page
      // without new ones is the end.
      offset += page.objects.size();
    }
    throw Error(ErrorCode::kTooLarge, "the PACS found more than " + std::to_string(kMost) +
                                          " objects, the most that are accepted");
  }

 private:
  // For a PACS that does not support `limit` or `offset`.
  SearchResults run_without_limit() && {
    const SearchPage page = fetch_(query_.target);
    if (page.refusal) {
      throw PacsFailure(PacsFault::kRefused, "the PACS rejected the search (status 400)");
    }
    results_.is_not_found = page.is_not_found;
    add(page.objects);
    results_.is_cut = page.has_more && !is_found();
    return std::move(results_);
  }

  // Returns true if one of the objects is new.
  bool add(const std::vector<PeersObject>& objects) {
    const std::size_t before = known_.size();
    for (const PeersObject& object : objects) {
      const std::string& uid = object.*query_.uid;
      if (uid.empty()) {
        throw PacsFailure(PacsFault::kUnreadable, "the PACS lists objects without UIDs");
      }
      if (known_.insert(uid).second) results_.objects.push_back(object);
    }
    return known_.size() > before;
  }

  bool is_found() const {
    if (query_.enough && known_.size() >= *query_.enough) return true;
    return query_.only && known_.contains(*query_.only);
  }

  const SearchQuery& query_;
  const FetchPage& fetch_;
  SearchResults results_;
  std::set<std::string> known_;
};

}  // namespace

SearchResults search_all(const SearchQuery& query, const FetchPage& fetch) {
  return Search(query, fetch).run();
}

std::optional<std::size_t> limit_named_in(const std::string& refusal, std::size_t limit) {
  if (lower(refusal).find("limit") == std::string::npos) return std::nullopt;
  std::optional<std::size_t> largest;
  const char* const end = refusal.data() + refusal.size();
  for (const char* at = refusal.data(); at != end;) {
    std::size_t number = 0;
    const auto [after, error] = std::from_chars(at, end, number);
    if (error == std::errc() && number > 0 && number < limit) {
      largest = std::max(largest.value_or(0), number);
    }
    at = after == at ? at + 1 : after;
  }
  return largest;
}

}  // namespace isomesh::dicomweb
