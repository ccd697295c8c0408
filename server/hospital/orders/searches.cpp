// Searches for series in a PACS, for somebody who wants to order one.
#include <algorithm>
#include <functional>
#include <string_view>

#include "base/text.h"
#include "server/hospital/orders/orders.h"
#include "server/hospital/orders/pattern.h"

namespace isomesh::orders {
namespace {

bool selects(std::string_view value) {
  return value.find_first_not_of("*?") != std::string_view::npos;
}

void check_query(const SeriesQuery& query) {
  if (selects(query.patient_id) || selects(query.patient_name) || !query.date.empty() ||
      !query.study.empty()) {
    return;
  }
  throw Error(ErrorCode::kInvalidParameter,
              "a search needs one of patient_id, patient_name, date and study, and more than "
              "wildcards in it");
}

bool is_in(std::string_view range, std::string_view day) {
  constexpr std::size_t kDigits = 8;
  if (day.size() != kDigits || !is_digits(day)) return true;  // as some old devices write it
  const std::size_t dash = range.find('-');
  const std::string_view first = range.substr(0, dash);
  const std::string_view last = dash == std::string_view::npos ? first : range.substr(dash + 1);
  return (first.empty() || first <= day) && (last.empty() || day <= last);
}

// A PACS that does not support a part of a query ignores it, and the series of other patients are
// not what was asked for. Only the PACS knows how it compares names.
bool is_asked_for(const PacsSeries& series, const SeriesQuery& query) {
  if (is_own_modality(series.modality)) return false;
  const auto fits = [](const std::string& asked, const std::string& told, auto is_match) {
    return asked.empty() || told.empty() || is_match(asked, told);
  };
  return fits(query.modality, series.modality, std::equal_to<>()) &&
         fits(query.patient_id, series.patient_id, matches) &&
         fits(query.date, series.study_date, is_in);
}

}  // namespace

PacsSeriesList Orders::search(const Orderer& orderer, const std::string& pacs,
                              const SeriesQuery& query) {
  check_query(query);
  check_searchable(settings_, orderer, pacs);
  const auto begin = [&] {
    const Lock lock(mutex_);
    if (searching_.stop_requested()) {
      throw Error(ErrorCode::kUnavailable, "the service is shutting down");
    }
    if (searched_.size() >= options_.searches ||
        searched_.count(pacs) >= options_.searches_per_pacs) {
      throw Error(ErrorCode::kUnavailable, "too many searches are in progress: try again soon");
    }
    return searched_.insert(pacs);
  };
  const struct GiveBack {
    Orders& orders;
    std::multiset<std::string>::iterator place;
    ~GiveBack() {
      const Lock lock(orders.mutex_);
      orders.searched_.erase(place);
    }
  } give_back{*this, begin()};
  store::AuditEntry entry = {.event = store::AuditEvent::kQuery,
                             .owner = orderer.name,
                             .peer_name = pacs,
                             .study = query.study,
                             .patient_id = query.patient_id};
  try {
    PacsSeriesList found = ask(pacs, query);
    services_.audit.add(entry);
    note_success(pacs);
    std::erase_if(found.series,
                  [&](const PacsSeries& series) { return !is_asked_for(series, query); });
    std::ranges::stable_sort(found.series, std::ranges::greater(), &PacsSeries::study_date);
    return found;
  } catch (const PacsFailure& failure) {
    entry.success = false;
    services_.audit.add(entry);
    note_failure(pacs, failure, "");
    throw;
  }
}

PacsSeriesList Orders::ask(const std::string& pacs, const SeriesQuery& query) const {
  try {
    return services_.peers.at(pacs).archive->search(
        query, std::chrono::steady_clock::now() + options_.longest_search, searching_.get_token());
  } catch (const PacsFailure&) {
    throw;
  } catch (const Error& error) {
    if (searching_.stop_requested()) {
      throw Error(ErrorCode::kUnavailable, "the service is shutting down");
    }
    if (error.code() == ErrorCode::kTooLarge) {
      throw PacsFailure(PacsFault::kRefused, std::string(error.what()) + ": search for less");
    }
    if (error.code() == ErrorCode::kPacsUnreachable) {
      throw PacsFailure(PacsFault::kUnreadable, error.what());
    }
    throw;
  }
}

}  // namespace isomesh::orders
