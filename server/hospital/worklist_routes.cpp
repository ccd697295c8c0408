#include "server/hospital/worklist_routes.h"

#include <algorithm>
#include <chrono>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "proto/dicom_uid.h"
#include "server/hospital/worklist/query.h"
#include "server/hospital/worklist/workitem.h"
#include "server/http/requests/upload.h"
#include "server/http/routes/routes.h"

namespace isomesh::hospital {
namespace {

using namespace http;
using store::WorkitemRecord;
using store::WorkitemStore;

const std::string kWorkitemsPath = "/v1/dicomweb/workitems";
constexpr const char* kDicomJson = "application/dicom+json";

// A search ends early rather than with a larger response. Peers, and the daemon itself, accept 16
// MiB.
constexpr std::size_t kMostResponseBytes = std::size_t{8} << 20;
constexpr std::uint64_t kMostStoredBytes = std::uint64_t{1} << 30;

const OwnWorklist& configured(const OwnWorklist* worklist) {
  if (worklist != nullptr) return *worklist;
  throw Error(ErrorCode::kNotFound,
              "this daemon has no worklist: its file of --hospital has no [worklist]");
}

store::Time time_now() { return std::chrono::system_clock::now(); }

void check_listed(const std::vector<std::string>& names, const Request& request, const char* what) {
  if (names.empty() || !viewer_of(request)) return;
  if (std::ranges::find(names, owner_of(request)) != names.end()) return;
  throw Error(ErrorCode::kForbidden,
              std::string("this login may not ") + what + " workitems: the operator lists who may");
}

void check_requester(const OwnWorklist& list, const Request& request) {
  check_listed(list.settings.requesters, request, "create, change or cancel");
}

void check_performer(const OwnWorklist& list, const Request& request) {
  check_listed(list.settings.performers, request, "perform");
}

// Both kinds need to read.
void check_reader(const OwnWorklist& list, const Request& request) {
  if (list.settings.requesters.empty() || list.settings.performers.empty()) return;
  std::vector<std::string> all = list.settings.requesters;
  all.insert(all.end(), list.settings.performers.begin(), list.settings.performers.end());
  check_listed(all, request, "read");
}

void warn(Response& response, const std::string& warning) {
  if (!warning.empty()) response.add_header("Warning", "299 isomesh \"" + warning + '"');
}

// Runs a rule. The header of a refusal has the sentence of the standard.
template <class Run>
auto with_warning(Response& response, const Run& run) {
  try {
    return run();
  } catch (const worklist::Refusal& refusal) {
    warn(response, refusal.warning());
    throw;
  }
}

// The UID that the standard has as the whole query: ?1.2.3. Empty without one.
std::string uid_in_query(const Request& request) {
  if (request.query.empty()) return "";
  const auto& [name, value] = request.query.front();
  const std::string& uid = value.empty() ? name : value;
  if (request.query.size() == 1 && is_uid(uid)) return uid;
  throw invalid_parameter(name, "is unknown: the query may have one UID only, as in ?1.2.3");
}

worklist::DataSet data_set_of(App& app, const Request& request) {
  check_has_length(request);
  if (request.header("Content-Type").empty()) {
    throw Error(ErrorCode::kUnsupportedMedia,
                std::string("the body needs the Content-Type ") + kDicomJson);
  }
  worklist::DataSet data =
      worklist::parse_data_set(json_body(app, request, kDicomJson, worklist::kMostBodyBytes));
  worklist::check_types(data);
  return data;
}

Error unknown_workitem() {
  return Error(ErrorCode::kNotFound, "the worklist has no workitem with this UID");
}

void answer_dicom_json(Response& response, std::string json) {
  response.status = 200;
  response.set_header("Cache-Control", "no-store");
  response.set_body(std::move(json), kDicomJson);
}

void create(App& app, const OwnWorklist* worklist, const Request& request, Response& response) {
  const OwnWorklist& list = configured(worklist);
  check_requester(list, request);
  const std::string uid = uid_in_query(request);
  const WorkitemRecord record = worklist::new_workitem(uid, data_set_of(app, request), time_now());
  if (app.draining) throw Error(ErrorCode::kUnavailable, "the service is shutting down");
  switch (
      list.workitems.add(record, {.most = list.settings.most, .most_bytes = kMostStoredBytes})) {
    case WorkitemStore::Added::kExists:
      throw Error(ErrorCode::kNotReady, "the worklist has a workitem with this UID already");
    case WorkitemStore::Added::kFull:
      throw Error(ErrorCode::kUnavailable, "the worklist is full (max-workitems)");
    case WorkitemStore::Added::kNew:
      break;
  }
  const std::string place = kWorkitemsPath + '/' + record.uid;
  response.status = 201;
  response.set_header("Location", place);
  response.set_header("Content-Location", place);
}

void tell_patient(Response& response, const worklist::DataSet& data) {
  response.told = ToldPatient{.what = "workitem",
                              .study = worklist::text_of(data, "0020000D"),
                              .patient_id = worklist::text_of(data, "00100020")};
}

void retrieve(const OwnWorklist* worklist, const Request& request, Response& response) {
  check_known(request, {});
  const OwnWorklist& list = configured(worklist);
  response.told = ToldPatient{.what = "workitem"};
  check_reader(list, request);
  const auto record = list.workitems.find(request.path_parameter("uid"));
  if (!record) {
    response.told.reset();
    throw unknown_workitem();
  }
  const worklist::DataSet data = worklist::data_of(*record);
  tell_patient(response, data);
  answer_dicom_json(response, '[' + data.dump() + ']');
}

void search(const OwnWorklist* worklist, const Request& request, Response& response) {
  const OwnWorklist& list = configured(worklist);
  response.told = ToldPatient{.what = "workitems"};
  check_reader(list, request);
  const worklist::Query query = worklist::parse_query(request.query);
  std::string found;
  std::size_t count = 0;
  std::size_t skipped = 0;
  bool has_more = false;
  list.workitems.read(query.state(), [&](const WorkitemRecord& record) {
    const auto data = worklist::readable_data(record);
    if (!data || !worklist::matches(query, *data)) return true;
    if (skipped < query.offset) {
      ++skipped;
      return true;
    }
    const std::string told = data->dump();  // a record may have more than the data set
    const bool fits = count == 0 || found.size() + told.size() < kMostResponseBytes;
    has_more = count >= query.limit || !fits;
    if (has_more) return false;
    found += (count == 0 ? "" : ",") + told;
    ++count;
    return true;
  });
  if (query.wants_fuzzy) {
    warn(response,
         "The fuzzymatching parameter is not supported. Only literal matching has been performed.");
  }
  if (has_more) warn(response, "There are additional results that can be requested");
  if (count > 0) return answer_dicom_json(response, '[' + found + ']');
  response.status = 204;
  response.set_header("Cache-Control", "no-store");
}

void answer_change(const Request& request, Response& response, int status) {
  response.status = status;
  response.set_header("Content-Location", kWorkitemsPath + '/' + request.path_parameter("uid"));
}

// Changes the workitem of the path and answers with that status.
void change(const OwnWorklist& list, const Request& request, Response& response, int status,
            const std::function<std::string(WorkitemRecord&)>& act) {
  std::string warning;
  const bool is_there = with_warning(response, [&] {
    return list.workitems.change(request.path_parameter("uid"),
                                 [&](WorkitemRecord& record) { warning = act(record); });
  });
  if (!is_there) throw unknown_workitem();
  warn(response, warning);
  answer_change(request, response, status);
}

void update(App& app, const OwnWorklist* worklist, const Request& request, Response& response) {
  const OwnWorklist& list = configured(worklist);
  check_reader(list, request);  // a login without rights learns nothing
  const std::string transaction = uid_in_query(request);
  const worklist::DataSet changes = data_set_of(app, request);
  change(list, request, response, 200, [&](WorkitemRecord& record) {
    record.state == store::WorkitemState::kScheduled ? check_requester(list, request)
                                                     : check_performer(list, request);
    worklist::update(record, changes, transaction, time_now());
    return std::string();
  });
}

void change_state(App& app, const OwnWorklist* worklist, const Request& request,
                  Response& response) {
  check_known(request, {});
  const OwnWorklist& list = configured(worklist);
  check_performer(list, request);
  const worklist::DataSet wanted = data_set_of(app, request);
  change(list, request, response, 200, [&](WorkitemRecord& record) {
    return worklist::change_state(record, wanted, time_now());
  });
}

void request_cancellation(App& app, const OwnWorklist* worklist, const Request& request,
                          Response& response) {
  check_known(request, {});
  const OwnWorklist& list = configured(worklist);
  check_requester(list, request);
  const worklist::DataSet reason =
      request.has_body() ? data_set_of(app, request) : worklist::DataSet::object();
  const auto known = list.workitems.find(request.path_parameter("uid"));
  if (known && known->state == store::WorkitemState::kInProgress &&
      list.cancel_performing(known->transaction)) {
    return answer_change(request, response, 202);
  }
  change(list, request, response, 202,
         [&](WorkitemRecord& record) { return worklist::cancel(record, reason, time_now()); });
}

}  // namespace

void add_worklist_routes(App& app, const OwnWorklist* worklist) {
  const std::string one = kWorkitemsPath + "/{uid}";
  add_post(app, kWorkitemsPath, [&app, worklist](const auto& request, auto& response) {
    create(app, worklist, request, response);
  });
  add_computed_get(app, kWorkitemsPath, [worklist](const auto& request, auto& response) {
    search(worklist, request, response);
  });
  add_get(app, one, [worklist](const auto& request, auto& response) {
    retrieve(worklist, request, response);
  });
  add_post(app, one, [&app, worklist](const auto& request, auto& response) {
    update(app, worklist, request, response);
  });
  add_put(app, one + "/state", [&app, worklist](const auto& request, auto& response) {
    change_state(app, worklist, request, response);
  });
  add_post(app, one + "/cancelrequest", [&app, worklist](const auto& request, auto& response) {
    request_cancellation(app, worklist, request, response);
  });
}

}  // namespace isomesh::hospital
