#include "server/hospital/orders/pacs.h"

#include <algorithm>
#include <array>

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

const FaultRow& row_of(PacsFault fault) {
  return *std::ranges::find(kFaults, fault, &FaultRow::fault);
}

}  // namespace

std::string_view to_string(PacsFault fault) { return row_of(fault).name; }

bool is_own_modality(std::string_view modality) {
  return std::ranges::find(kOwnModalities, modality) != kOwnModalities.end();
}

PacsFailure::PacsFailure(PacsFault fault, const std::string& detail,
                         std::chrono::seconds retry_after)
    : Error(Error(row_of(fault).code, detail).with_retry_after(retry_after)), fault_(fault) {}

}  // namespace isomesh::orders
