#include "server/hospital/orders/pacs.h"

#include <algorithm>
#include <array>
#include <functional>

#include "base/text.h"
#include "server/hospital/orders/pattern.h"

namespace isomesh::orders {
namespace {

struct FaultRow {
  PacsFault fault;
  std::string_view name;
  ErrorCode code;
};

constexpr std::array kFaults = {
    FaultRow{PacsFault::kUnreachable, "unreachable", ErrorCode::kPacsUnreachable},
    FaultRow{PacsFault::kTimeout, "timeout", ErrorCode::kPacsUnreachable},
    FaultRow{PacsFault::kBusy, "busy", ErrorCode::kPacsUnreachable},
    FaultRow{PacsFault::kUnauthorized, "unauthorized", ErrorCode::kPacsRefused},
    FaultRow{PacsFault::kRefused, "refused", ErrorCode::kPacsRefused},
    FaultRow{PacsFault::kUnreadable, "unreadable", ErrorCode::kPacsUnreachable},
    FaultRow{PacsFault::kIncomplete, "incomplete", ErrorCode::kSeriesIncomplete},
    FaultRow{PacsFault::kNotStored, "not-stored", ErrorCode::kPacsUnreachable},
    FaultRow{PacsFault::kChanged, "changed", ErrorCode::kSeriesIncomplete}};

constexpr std::array<std::string_view, 2> kOwnModalities = {"M3D", "SR"};

bool is_in(std::string_view range, std::string_view day) {
  constexpr std::size_t kDigits = 8;
  if (day.size() != kDigits || !is_digits(day)) return true;  // as some old devices write it
  const std::size_t dash = range.find('-');
  const std::string_view first = range.substr(0, dash);
  const std::string_view last = dash == std::string_view::npos ? first : range.substr(dash + 1);
  return (first.empty() || first <= day) && (last.empty() || day <= last);
}

const FaultRow& row_of(PacsFault fault) {
  return *std::ranges::find(kFaults, fault, &FaultRow::fault);
}

}  // namespace

std::string_view to_string(PacsFault fault) { return row_of(fault).name; }

bool is_own_modality(std::string_view modality) {
  return std::ranges::find(kOwnModalities, modality) != kOwnModalities.end();
}

bool is_asked_for(const PacsSeries& series, const SeriesQuery& query) {
  if (is_own_modality(series.modality)) return false;
  const auto fits = [](const std::string& asked, const std::string& told, auto is_match) {
    return asked.empty() || told.empty() || is_match(asked, told);
  };
  return fits(query.study, series.study, std::equal_to<>()) &&
         fits(query.modality, series.modality, std::equal_to<>()) &&
         fits(query.patient_id, series.patient_id, matches) &&
         fits(query.date, series.study_date, is_in);
}

PacsFailure::PacsFailure(PacsFault fault, const std::string& detail,
                         std::chrono::seconds retry_after)
    : Error(Error(row_of(fault).code, detail).with_retry_after(retry_after)), fault_(fault) {}

}  // namespace isomesh::orders
