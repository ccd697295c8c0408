// The public description beside a running daemon with a finished job.
#pragma once

#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "server/hospital/protocol/orders.h"
#include "tests/api/daemon.h"
#include "tests/api/schema.h"
#include "tests/support/receiver.h"

namespace isomesh::test {

inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t found = text.find(from);
  return found == std::string::npos ? text : text.replace(found, from.size(), to);
}

// A hospital with a PACS that does not answer, and one that finds nothing.
class HospitalFile {
 public:
  HospitalFile() {
    write_file(folder_ / "hospital.toml",
               "[worklist]\n[[pacs]]\nname = \"absent\"\ndicomweb = \"http://127.0.0.1:1/\"\n"
               "[[pacs]]\nname = \"empty\"\ndicomweb = \"" +
                   pacs_.url() + "\"\n");
  }
  std::string path() const { return folder_ / "hospital.toml"; }

 private:
  TemporaryFolder folder_;
  const Receiver pacs_{{204}};
};

class OpenApiTest : public testing::Test {
 protected:
  std::vector<std::string> faults(const std::string& body, const std::string& schema) {
    return api_.faults(nlohmann::json::parse(body), api_.schema(schema));
  }

  // The methods of a path as the server's Allow header would name them.
  static std::set<std::string> methods_of(const YAML::Node& path_item) {
    std::set<std::string> methods;
    if (path_item["get"]) methods.insert({"GET", "HEAD"});
    if (path_item["post"]) methods.insert("POST");
    if (path_item["delete"]) methods.insert("DELETE");
    if (path_item["patch"]) methods.insert("PATCH");
    if (path_item["put"]) methods.insert("PUT");
    return methods;
  }

  // A path with the ids of what is there.
  std::string example_of(const std::string& path) {
    const std::string& id = path.starts_with("/v1/volumes")  ? job_.parameters.volume
                            : path.starts_with("/v1/orders") ? order_.id
                                                             : job_.id;
    const std::string known = replaced(replaced(path, "{format}", "drc"), "{name}", "absent");
    return replaced(replaced(known, "{id}", id), "{uid}", "1.2.3");
  }

  // An order that waits for a PACS which does not answer.
  static constexpr const char* kOrder =
      R"({"source": {"pacs": "absent", "study": "1.2", "series": "1.3"},
          "parameters": {"iso": 1}, "send": [{"pacs": "absent"}]})";

  // As POST /v1/dicomweb/workitems accepts it.
  static constexpr const char* kWorkitem =
      R"({"00741000": {"vr": "CS", "Value": ["SCHEDULED"]},
          "00741200": {"vr": "CS", "Value": ["LOW"]}, "00741204": {"vr": "LO", "Value": ["Mesh"]},
          "00404041": {"vr": "CS", "Value": ["READY"]},
          "00404005": {"vr": "DT", "Value": ["20260101"]}})";

  const HospitalFile hospital_;
  Daemon daemon_{{"--hospital", hospital_.path()}};
  const Order order_ = order_from_json(daemon_.send("POST", "/v1/orders", kOrder).body);
  const Answer workitem_ = daemon_.send("POST", "/v1/dicomweb/workitems?1.2.3", kWorkitem,
                                        {{"Content-Type", "application/dicom+json"}});
  const Job job_ = finished_job(daemon_);
  const OpenApi api_{daemon_.get("/openapi.yaml").body};
};

}  // namespace isomesh::test
