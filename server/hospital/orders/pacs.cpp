#include "server/hospital/orders/pacs.h"

namespace isomesh::orders {
namespace {

ErrorCode code_of(PacsFault fault) {
  switch (fault) {
    case PacsFault::kUnauthorized:
    case PacsFault::kRefused:
      return ErrorCode::kPacsRefused;
    case PacsFault::kIncomplete:
    case PacsFault::kChanged:
      return ErrorCode::kSeriesIncomplete;
    case PacsFault::kUnreachable:
    case PacsFault::kTimeout:
    case PacsFault::kBusy:
    case PacsFault::kUnreadable:
    case PacsFault::kNotStored:
      break;
  }
  return ErrorCode::kPacsUnreachable;
}

}  // namespace

std::string_view to_string(PacsFault fault) {
  switch (fault) {
    case PacsFault::kUnreachable:
      return "unreachable";
    case PacsFault::kTimeout:
      return "timeout";
    case PacsFault::kBusy:
      return "busy";
    case PacsFault::kUnauthorized:
      return "unauthorized";
    case PacsFault::kRefused:
      return "refused";
    case PacsFault::kUnreadable:
      return "unreadable";
    case PacsFault::kIncomplete:
      return "incomplete";
    case PacsFault::kNotStored:
      return "not-stored";
    case PacsFault::kChanged:
      return "changed";
  }
  return "";
}

PacsFailure::PacsFailure(PacsFault fault, const std::string& detail,
                         std::chrono::seconds retry_after)
    : Error(Error(code_of(fault), detail).with_retry_after(retry_after)), fault_(fault) {}

}  // namespace isomesh::orders
