// Searches for series in a PACS, for somebody who wants to order one.
#include <string_view>
#include <utility>

#include "server/hospital/orders/orders.h"

namespace isomesh::orders {
namespace {

bool selects(std::string_view value) {
  return value.find_first_not_of("*?^= ") != std::string_view::npos;
}

void check_query(const SeriesQuery& query) {
  if (selects(query.patient_id) || selects(query.patient_name) || !query.date.empty() ||
      !query.study.empty()) {
    return;
  }
  throw Error(ErrorCode::kInvalidParameter,
              "a search needs a patient's ID or name, a date or a study; wildcards alone are not "
              "enough");
}

// The query as it would be in a URL, for the audit trail.
std::string text_of(const SeriesQuery& query) {
  std::string text;
  for (const auto& [name, value] :
       {std::pair{"PatientID", &query.patient_id}, std::pair{"PatientName", &query.patient_name},
        std::pair{"StudyDate", &query.date}, std::pair{"ModalitiesInStudy", &query.modality},
        std::pair{"StudyInstanceUID", &query.study}}) {
    if (value->empty()) continue;
    text.append(text.empty() ? "" : "&").append(name).append("=").append(*value);
  }
  return text;
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
                             .patient_id = query.patient_id,
                             .query = text_of(query)};
  try {
    PacsSeriesList found = ask(pacs, query);
    services_.audit.add(entry);
    note_success(pacs);
    return found;
  } catch (const Error&) {
    entry.success = false;
    services_.audit.add(entry);
    throw;
  }
}

PacsSeriesList Orders::ask(const std::string& pacs, const SeriesQuery& query) {
  try {
    return services_.peers.at(pacs).archive->search(
        query, std::chrono::steady_clock::now() + options_.longest_search, searching_.get_token());
  } catch (const PacsFailure& failure) {
    note_failure(pacs, failure, "");
    throw;
  } catch (const Error& error) {
    if (searching_.stop_requested()) {
      throw Error(ErrorCode::kUnavailable, "the service is shutting down");
    }
    if (error.code() == ErrorCode::kTooLarge) {
      throw PacsFailure(PacsFault::kRefused, std::string(error.what()) + ": narrow the search");
    }
    if (error.code() == ErrorCode::kPacsUnreachable) {
      throw PacsFailure(PacsFault::kUnreadable, error.what());
    }
    throw;
  }
}

}  // namespace isomesh::orders
