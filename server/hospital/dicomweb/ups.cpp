#include "server/hospital/dicomweb/ups.h"

#include <algorithm>
#include <utility>

#include "base/files.h"
#include "server/hospital/dicomweb/dicomweb.h"
#include "server/hospital/dicomweb/search.h"

namespace isomesh::dicomweb {
namespace {

using orders::FoundWorkitem;

constexpr std::uint64_t kMostWorklistBytes = std::uint64_t{16} << 20;
constexpr const char* kWorkitemJson = "application/dicom+json";
constexpr int kNotFound = 404;
constexpr int kGone = 410;

FoundWorkitem workitem_of(const PeersObject& object) {
  return {.uid = object.instance,
          .state = object.workitem_state,
          .readiness = object.readiness,
          .patient_id = object.patient_id,
          .study = object.study,
          .series = object.series,
          .procedures = object.procedures};
}

}  // namespace

std::vector<FoundWorkitem> Ups::find_scheduled(const std::stop_token& stop) {
  const auto fetch = [&](const std::string& target) -> SearchPage {
    constexpr int kBadRequest = 400;
    constexpr std::size_t kEnoughOfText = 4096;
    const ScratchFile response(scratch_, ".response");
    const PeerResponseHead head = peer_.send({.target = target,
                                              .accept = kWorkitemJson,
                                              .response_file = response.path(),
                                              .most_bytes = kMostWorklistBytes},
                                             stop);
    if (head.status == kBadRequest) {
      return {.refusal = InputFile(response.path()).text(0, kEnoughOfText)};
    }
    check_status(head);
    return {.objects = read_response(responses_, response.path()).objects,
            .has_more = head.has_more_results};
  };
  const SearchResults results =
      search_all({.target = "/workitems?ProcedureStepState=SCHEDULED&includefield=00100020&"
                            "includefield=00404018&includefield=00404021&includefield=00404041",
                  .uid = &PeersObject::instance},
                 fetch);
  std::vector<FoundWorkitem> found;
  for (const PeersObject& object : results.objects) found.push_back(workitem_of(object));
  return found;
}

std::optional<FoundWorkitem> Ups::find_workitem(const std::string& uid,
                                                const std::stop_token& stop) {
  const ScratchFile response(scratch_, ".response");
  const PeerResponseHead head = peer_.send({.target = "/workitems/" + uid,
                                            .accept = kWorkitemJson,
                                            .response_file = response.path(),
                                            .most_bytes = kMostWorklistBytes},
                                           stop);
  if (head.status == kNotFound || head.status == kGone) return std::nullopt;
  check_status(head);
  const PeersResponse said = read_response(responses_, response.path());
  if (said.objects.empty()) return std::nullopt;
  return workitem_of(said.objects.front());
}

bool Ups::send(const std::string& target, bool is_put, const std::string& json,
               const std::stop_token& stop) const {
  std::size_t at = 0;
  const RequestBody body = {.content_type = kWorkitemJson,
                            .bytes = json.size(),
                            .read = [&](std::span<std::byte> buffer) {
                              const auto rest = std::as_bytes(std::span(json)).subspan(at);
                              const std::size_t count = std::min(rest.size(), buffer.size());
                              std::copy_n(rest.begin(), count, buffer.begin());
                              at += count;
                              return count;
                            }};
  const ScratchFile response(scratch_, ".response");
  const PeerResponseHead head = peer_.send({.target = target,
                                            .accept = kWorkitemJson,
                                            .body = &body,
                                            .is_put = is_put,
                                            .response_file = response.path(),
                                            .most_bytes = kMostWorklistBytes},
                                           stop);
  constexpr int kBadRequest = 400;
  constexpr int kConflict = 409;
  for (const int rejected : {kBadRequest, kNotFound, kConflict, kGone}) {
    if (head.status == rejected) return false;
  }
  check_status(head);
  return true;
}

bool Ups::change_state(const Workitem& item, const std::string& state,
                       const std::stop_token& stop) {
  return send("/workitems/" + item.uid + "/state", true,
              R"([{"00081195":{"vr":"UI","Value":[")" + item.transaction +
                  R"("]},"00741000":{"vr":"CS","Value":[")" + state + R"("]}}])",
              stop);
}

// The standard has the transaction in the query; some worklists want it among the attributes.
bool Ups::update(const Workitem& item, const std::string& changes, const std::stop_token& stop) {
  return send("/workitems/" + item.uid + '?' + item.transaction, false, '[' + changes + ']', stop);
}

}  // namespace isomesh::dicomweb
