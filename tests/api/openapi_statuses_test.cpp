// The statuses of the public description against those of the running server, both ways.
#include <algorithm>
#include <cctype>
#include <map>
#include <set>
#include <string>

#include <gtest/gtest.h>

#include "client/isomesh/package.h"
#include "proto/json.h"
#include "tests/api/openapi.h"
#include "tests/support/nifti.h"

namespace isomesh {
namespace {

using namespace test;

// Statuses that every operation may return without declaring them; the description's first words
// name them.
const std::set<int> kCommon = {401, 403, 404, 405, 408, 414, 429, 431, 500, 503};

// Answers that need another daemon, S3, a full disk or a long time; other tests cause them.
const std::set<std::string> kElsewhere = {"307", "401", "403", "410",
                                          "429", "503", "507", "default"};

// The statuses of requests, by operation.
class Statuses {
 public:
  explicit Statuses(const Daemon& daemon) : daemon_(daemon) {}

  // The request is the operation's; its target begins with the path, ids filled in.
  Answer probe(const std::string& operation, const std::string& target,
               const std::string& body = {}, const Headers& headers = {}) {
    const std::string method = operation.substr(0, operation.find(' '));
    Answer answer = daemon_.send(method, target, body, headers);
    seen_[operation].insert(answer.status);
    return answer;
  }
  void see(const std::string& operation, const std::string& bytes) {
    seen_[operation].insert(answer_to(daemon_.url(), bytes).status);
  }

  void see_without_length(const std::string& operation, const std::string& path) {
    see(operation, operation.substr(0, operation.find(' ') + 1) + path +
                       " HTTP/1.1\r\nHost: localhost\r\n\r\n");
  }

  // What anybody may ask of one thing that has this id.
  void probe_one(const std::string& operation, const std::string& target, const std::string& id) {
    probe(operation, target + "?x=1");
    probe(operation, replaced(target, id, "0123"));
    probe(operation, target, {}, {{"If-None-Match", "*"}});
    probe(operation, target, {}, {{"If-Match", "\"x\""}});
  }

  // Bodies that no operation takes.
  void probe_bodies(const std::string& operation, const std::string& target) {
    probe(operation, target, "{}");
    probe(operation, target, std::string(70'000, ' '));
    probe(operation, target, "{}", {{"Content-Type", "text/plain"}});
    see_without_length(operation, target);
  }

  // A stream that ends only when the client has gone.
  void listen(const std::string& operation, const std::string& target) {
    const Connection connection(daemon_.url());
    connection.send(request("GET", target));
    seen_[operation].insert(std::stoi(connection.receive_some().substr(9, 3)));  // HTTP/1.1 200
  }

  const std::set<int>& of(const std::string& operation) { return seen_[operation]; }

 private:
  const Daemon& daemon_;
  std::map<std::string, std::set<int>> seen_;
};

// An archive of two.
std::string two_volumes() {
  const TemporaryFolder folder;
  for (const char* name : {"a.nrrd", "b.nrrd"}) {
    write_file(folder / name,
               "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: raw\n\n" +
                   std::string(7, 'a') + name[0]);
  }
  const UploadBody body(folder.path());
  std::string bytes(body.size(), '\0');
  body.read(0, bytes);
  return bytes;
}

void probe_volumes(Statuses& statuses, const Job& running, const std::string& id) {
  const RawUpload sphere = sphere_upload();
  const std::string post = "POST /v1/volumes";
  statuses.probe(post, "/v1/volumes?" + sphere.query, sphere.bytes);
  statuses.probe(post, "/v1/volumes?dims=2,2,2&type=uint8", "12345678");
  statuses.probe(post, "/v1/volumes", "garbage");
  statuses.probe(post, "/v1/volumes", "");
  statuses.probe(post, "/v1/volumes", read_file(kBrainFile).substr(0, 5000));
  statuses.see_without_length(post, "/v1/volumes");
  statuses.see(post,
               "POST /v1/volumes HTTP/1.1\r\nHost: localhost\r\n"
               "Content-Length: 99999999999999\r\n\r\n");
  statuses.probe(post, "/v1/volumes", two_volumes());
  statuses.probe(post, "/v1/volumes?upload=" + std::string(32, '0'));
  statuses.probe("GET /v1/volumes", "/v1/volumes");
  statuses.probe("GET /v1/volumes", "/v1/volumes?cursor=x");
  for (const std::string part : {"", "/histogram", "/labels", "/slice.png", "/slice", "/preview"}) {
    const std::string get = "GET /v1/volumes/{id}" + part;
    statuses.probe(get, "/v1/volumes/" + id + part);
    statuses.probe_one(get, "/v1/volumes/" + id + part, id);
  }
  const std::string rename = "PATCH /v1/volumes/{id}";
  const std::string name = R"({"name": "head"})";
  statuses.probe(rename, "/v1/volumes/" + id, name);
  statuses.probe(rename, "/v1/volumes/0123", name);
  statuses.probe(rename, "/v1/volumes/" + id, name, {{"If-Match", "\"x\""}});
  statuses.probe_bodies(rename, "/v1/volumes/" + id);
  const std::string reorient = "POST /v1/volumes/{id}/reoriented";
  const std::string turned = "/v1/volumes/" + id + "/reoriented?axes=y,-x,z";
  statuses.probe(reorient, turned);
  statuses.probe(reorient, turned);
  statuses.probe(reorient, "/v1/volumes/" + id + "/reoriented");
  statuses.probe(reorient, "/v1/volumes/0123/reoriented?axes=-x,y,z");
  const std::string sheared = "?dims=2,2,2&type=uint8&direction=1,0,0,0,1,0.6,0,0,0.8";
  const Volume other =
      volume_from_json(statuses.probe(post, "/v1/volumes" + sheared, "12345678").body);
  statuses.probe(reorient, "/v1/volumes/" + other.id + "/reoriented?axes=y,-x,z");
  const std::string erase = "DELETE /v1/volumes/{id}";
  statuses.probe(erase, "/v1/volumes/" + running.parameters.volume);
  statuses.probe(erase, "/v1/volumes/" + id + "?x=1");
  statuses.probe(erase, "/v1/volumes/" + id, {}, {{"If-Match", "\"x\""}});
  statuses.probe(erase, "/v1/volumes/" + id);
  statuses.probe(erase, "/v1/volumes/" + id);
}

void probe_uploads(Statuses& statuses, const Daemon& daemon) {
  const std::string post = "POST /v1/volumes";
  const Headers begin = {{"Upload-Complete", "?0"}};
  const auto place_for = [&](const std::string& query) {
    return daemon.send("POST", "/v1/volumes" + query, {}, begin).header("location");
  };
  const auto part = [](bool is_last, const Headers& more = {}) {
    return with({{"Content-Type", "application/partial-upload"},
                 {"Upload-Offset", "0"},
                 {"Upload-Complete", is_last ? "?1" : "?0"}},
                more);
  };
  const std::string patch = "PATCH /v1/uploads/{id}";
  const RawUpload sphere = sphere_upload();
  const std::string place = place_for('?' + sphere.query);
  statuses.probe(post, "/v1/volumes?upload=" + place.substr(place.rfind('/') + 1));
  statuses.probe(patch, place, sphere.bytes, part(true));
  statuses.probe(patch, place_for('?' + sphere.query), sphere.bytes, part(true));
  statuses.probe(patch, place_for("?dims=2,2,1&type=uint8"), "1234", part(true));
  statuses.probe(patch, place_for(""), two_volumes(), part(true));
  statuses.probe(patch, place_for(""), "garbage", part(true));
  statuses.probe(patch, place_for(""), read_file(kBrainFile).substr(0, 5000), part(true));
  const std::string open = place_for("");
  statuses.probe(patch, open, "begin", part(false));
  statuses.probe(patch, open, "begin", part(false));
  statuses.probe(patch, open, "begin", part(false, {{"Upload-Length", "99999999999999"}}));
  statuses.probe(patch, open + "?x=1", "begin", part(false));
  statuses.probe("DELETE /v1/uploads/{id}", place);
  statuses.probe("GET /v1/uploads/{id}", place);
  statuses.see_without_length(patch, open);
  for (const std::string method : {"GET", "DELETE"}) {
    statuses.probe(method + " /v1/uploads/{id}", open + "?x=1");
    statuses.probe(method + " /v1/uploads/{id}", open);
  }
}

void probe_jobs(Statuses& statuses, const Job& job) {
  const std::string post = "POST /v1/jobs";
  const std::string body = job_body(job.parameters.volume, 100);
  const Headers key = {{"Idempotency-Key", "k"}};
  statuses.probe(post, "/v1/jobs", body, key);
  statuses.probe(post, "/v1/jobs", body + ' ', key);
  statuses.probe(post, "/v1/jobs?wait=30", body);
  statuses.probe(post, "/v1/jobs", R"({"volume": "0123", "iso": 1})");
  statuses.probe_bodies(post, "/v1/jobs");
  statuses.probe("GET /v1/jobs", "/v1/jobs");
  statuses.probe("GET /v1/jobs", "/v1/jobs?state=x");
  statuses.probe("GET /v1/estimate", "/v1/estimate?iso=1&volume=" + job.parameters.volume);
  statuses.probe("GET /v1/estimate", "/v1/estimate?iso=1&volume=0123");
  statuses.probe("GET /v1/estimate", "/v1/estimate");
  statuses.probe("GET /v1/jobs/{id}", "/v1/jobs/" + job.id);
  statuses.probe_one("GET /v1/jobs/{id}", "/v1/jobs/" + job.id, job.id);
  const std::string events = "GET /v1/jobs/{id}/events";
  statuses.probe(events, "/v1/jobs/" + job.id + "/events");
  statuses.probe(events, "/v1/jobs/" + job.id + "/events?x=1");
  statuses.probe(events, "/v1/jobs/0123/events");
  statuses.probe(events, "/v1/jobs/" + job.id + "/events", {},
                 {{"Last-Event-ID", "9999999999999999999"}});
  statuses.listen("GET /v1/events", "/v1/events");
  statuses.listen("GET /v1/events", "/v1/events?x=1");
}

void probe_erasing(Statuses& statuses, const Job& job) {
  const std::string erase = "DELETE /v1/jobs/{id}";
  const std::string path = "/v1/jobs/" + job.id;
  statuses.probe(erase, path + "?erase=false");
  statuses.probe(erase, path + "?x=1");
  statuses.probe(erase, path, {}, {{"If-Match", "\"x\""}});
  statuses.probe(erase, path);
  statuses.probe(erase, path);
}

void probe_job_labels(Statuses& statuses, const Job& job, const Job& running) {
  for (const std::string part : {"/labels", "/walls", "/mesh.mtl", "/report"}) {
    const std::string get = "GET /v1/jobs/{id}" + part;
    const std::string path = "/v1/jobs/" + job.id + part;
    statuses.probe(get, path);
    statuses.probe(get, "/v1/jobs/" + running.id + part);
    statuses.probe_one(get, path, job.id);
  }
}

void probe_meshes(Statuses& statuses, const Job& job, const Job& running) {
  const std::string get = "GET /v1/jobs/{id}/mesh.{format}";
  const std::string mesh = "/v1/jobs/" + job.id + "/mesh.drc";
  statuses.probe(get, mesh);
  statuses.probe(get, "/v1/jobs/" + running.id + "/mesh.drc");
  statuses.probe_one(get, mesh, job.id);
  statuses.probe(get, mesh, {}, {{"Range", "bytes=0-1"}});
  statuses.probe(get, mesh, {}, {{"Range", "bytes=99999999-"}});
  const std::string post = "POST /v1/mesh";
  const RawUpload sphere = sphere_upload();
  const std::string target = "/v1/mesh?iso=100&" + sphere.query;
  statuses.probe(post, target, sphere.bytes, {{"Idempotency-Key", "m"}});
  statuses.probe(post, target + "&passes=1", sphere.bytes, {{"Idempotency-Key", "m"}});
  statuses.probe(post, "/v1/mesh", "garbage");
  statuses.probe(post, "/v1/mesh?iso=1", "garbage");
  statuses.see_without_length(post, "/v1/mesh?iso=1");
  statuses.see(post,
               "POST /v1/mesh?iso=1 HTTP/1.1\r\nHost: localhost\r\n"
               "Content-Length: 99999999999999\r\n\r\n");
  statuses.probe("GET /livez", "/livez");
  EXPECT_TRUE(eventually([&] {  // the first check may take longer than the answer waits for it
    statuses.probe("GET /readyz", "/readyz");
    return statuses.of("GET /readyz").contains(200);
  }));
  statuses.probe("GET /metrics", "/metrics");
  statuses.probe("GET /metrics", "/metrics?x=1");
  statuses.probe("GET /version", "/version");
  statuses.probe("GET /version", "/version?no=1");
  statuses.probe("GET /login", "/login");
  statuses.probe("GET /login", "/login?no=1");
  statuses.probe("GET /openapi.yaml", "/openapi.yaml");
  for (const std::string path : {"/", "/client.js"}) {
    statuses.probe("GET " + path, path);
    statuses.probe("GET " + path, path, {}, {{"If-None-Match", "*"}});
  }
}

void probe_orders(Statuses& statuses, const Order& order, const std::string& body) {
  const std::string post = "POST /v1/orders";
  const Headers key = {{"Idempotency-Key", "o"}};
  const std::string other =
      R"({"source": {"pacs": "absent", "study": "1.2", "series": "1.4"},
          "parameters": {"iso": 1}, "send": []})";
  statuses.probe(post, "/v1/orders", body, key);
  statuses.probe(post, "/v1/orders", body, key);
  statuses.probe(post, "/v1/orders", other, key);
  statuses.probe_bodies(post, "/v1/orders");
  statuses.probe("GET /v1/orders", "/v1/orders");
  statuses.probe("GET /v1/orders", "/v1/orders?state=x");
  statuses.probe("GET /v1/pacs", "/v1/pacs");
  statuses.probe("GET /v1/pacs", "/v1/pacs?x=1");
  for (const std::string query :
       {"empty/series?study=1.2", "unknown/series?study=1.2", "absent/series",
        "absent/series?date=20261130-", "absent/series?date=20261130-20261101"}) {
    statuses.probe("GET /v1/pacs/{name}/series", "/v1/pacs/" + query);
  }
  const std::string one = "/v1/orders/" + order.id;
  statuses.probe("GET /v1/orders/{id}", one);
  const std::string retry = "POST /v1/orders/{id}/retry";
  statuses.probe(retry, one + "/retry");
  statuses.probe(retry, "/v1/orders/0123/retry");
  statuses.probe(retry, one + "/retry?x=1");
  statuses.see_without_length(retry, one + "/retry");
  for (const std::string method : {"GET", "DELETE"}) {
    statuses.probe_one(method + " /v1/orders/{id}", one, order.id);
  }
  statuses.probe("DELETE /v1/orders/{id}", one);
}

void probe_worklist(Statuses& statuses, const std::string& item) {
  const std::string all = "/v1/dicomweb/workitems";
  const std::string one = all + "/1.2.9";
  const Headers dicom_json = {{"Content-Type", "application/dicom+json"}};
  const std::string claim =
      R"({"00741000": {"vr": "CS", "Value": ["IN PROGRESS"]},
          "00081195": {"vr": "UI", "Value": ["1.99"]}})";
  statuses.probe("GET " + all, all + "?PatientID=nobody");
  for (int n = 0; n < 2; ++n) statuses.probe("POST " + all, all + "?1.2.9", item, dicom_json);
  statuses.probe("GET " + all, all);
  statuses.probe("GET " + all, all + "?x=1");
  statuses.probe("GET " + all + "/{uid}", one);
  statuses.probe("GET " + all + "/{uid}", one + "?x=1");
  for (int n = 0; n < 2; ++n)
    statuses.probe("PUT " + all + "/{uid}/state", one + "/state", claim, dicom_json);
  statuses.probe("POST " + all + "/{uid}", one + "?1.99", "{}", dicom_json);
  statuses.probe("POST " + all + "/{uid}/cancelrequest", one + "/cancelrequest");
  statuses.probe("POST " + all, all + "?1.2.10", item, dicom_json);
  statuses.probe("POST " + all + "/{uid}/cancelrequest", all + "/1.2.10/cancelrequest");
  statuses.probe("GET " + all + "/{uid}", all + "/1.2.11");
  for (const auto& [operation, path] :
       {std::pair<std::string, std::string>{"POST " + all, ""},
        {"POST " + all + "/{uid}", "/1.2.11"},
        {"PUT " + all + "/{uid}/state", "/1.2.11/state"},
        {"POST " + all + "/{uid}/cancelrequest", "/1.2.11/cancelrequest"}}) {
    statuses.probe(operation, all + path, claim, dicom_json);
    statuses.probe(operation, all + path, "[", dicom_json);
    statuses.probe(operation, all + path, std::string(1'100'000, ' '), dicom_json);
    statuses.probe(operation, all + path, "{}", {{"Content-Type", "text/plain"}});
    statuses.see_without_length(operation, all + path);
  }
}

// Requests about a volume whose samples are damaged on the disk.
void probe_damaged(Statuses& statuses, const Daemon& daemon) {
  const Volume volume =
      volume_from_json(daemon.send("POST", "/v1/volumes?dims=2,2,2&type=uint8", "87654321").body);
  const std::string& id = volume.id;
  write_file(daemon.data() / "blobs" / volume.samples.substr(0, 2) / volume.samples, "spoilt");
  for (const std::string part : {"/histogram", "/labels", "/slice.png", "/slice", "/preview"}) {
    statuses.probe("GET /v1/volumes/{id}" + part, "/v1/volumes/" + id + part);
  }
  statuses.probe("GET /v1/estimate", "/v1/estimate?iso=1&volume=" + id);
}

// Both ways: what is answered is described, and what is described is answered.
TEST_F(OpenApiTest, TheStatusesAreThoseOfTheServer) {
  const Job running = long_job(daemon_);
  Statuses statuses(daemon_);
  probe_jobs(statuses, job_);
  probe_job_labels(statuses, job_, running);
  probe_meshes(statuses, job_, running);
  probe_erasing(statuses, job_);
  probe_volumes(statuses, running, job_.parameters.volume);
  probe_uploads(statuses, daemon_);
  probe_damaged(statuses, daemon_);
  probe_orders(statuses, order_, kOrder);
  probe_worklist(statuses, kWorkitem);
  for (const auto& path : api_.paths()) {
    for (const auto& operation : path.second) {
      std::string name = operation.first.as<std::string>();
      if (name == "parameters") continue;
      std::ranges::transform(name, name.begin(), [](char c) { return std::toupper(c); });
      name += ' ' + path.first.as<std::string>();
      std::set<std::string> described;
      for (const auto& response : operation.second["responses"]) {
        described.insert(response.first.as<std::string>());
      }
      for (const int status : statuses.of(name)) {
        EXPECT_TRUE(described.contains(std::to_string(status)) || kCommon.contains(status))
            << name << " answers " << status;
      }
      for (const std::string& status : described) {
        EXPECT_TRUE(kElsewhere.contains(status) || statuses.of(name).contains(std::stoi(status)) ||
                    name + ' ' + status ==
                        "POST /v1/mesh 409" ||  // cancelled while it is waited for
                    name + ' ' + status == "POST /v1/orders/{id}/retry 202")  // none failed
            << name << " never answers " << status;
      }
    }
  }
  daemon_.client().cancel(running.id);
}

}  // namespace
}  // namespace isomesh
