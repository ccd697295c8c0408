// Parameters that are refused by name, wherever they may be given.
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/api/daemon.h"
#include "tests/api/problems.h"

namespace isomesh {
namespace {

using namespace test;

struct Wrong {
  std::string method;
  std::string target;  // "VOLUME", "JOB" and "RAW" stand for ids and for what describes the body
  std::string field;
  std::vector<std::string> values;  // each ends the target
};

const std::vector<Wrong>& all_wrong() {
  static const std::vector<Wrong> all = {
      {"GET", "/v1/volumes/VOLUME/histogram?bins=", "bins", {"0", "65537", "-1", "1.5", "ten", ""}},
      {"GET", "/v1/volumes/VOLUME/histogram?", "bin", {"bin=2"}},
      {"GET",
       "/v1/volumes/VOLUME/labels?background=",
       "background",
       {"", "x", "1.5", "+1", "%2B1", "99999999999999999999"}},
      {"GET", "/v1/volumes/VOLUME/labels?", "bins", {"bins=1"}},
      {"GET", "/v1/volumes/VOLUME/slice.png?axis=", "axis", {"w", "", "xy", "X"}},
      {"GET", "/v1/volumes/VOLUME/slice.png?axis=z&index=", "index", {"19", "-1", "", "1.5"}},
      {"GET",
       "/v1/volumes/VOLUME/slice.png?window=",
       "window",
       {"1", "1,1", "2,1", "nan,1", "0,inf", "0,1,2", ",", ""}},
      {"GET", "/v1/volumes/VOLUME/slice.png?", "zoom", {"zoom=2"}},
      {"GET", "/v1/volumes/VOLUME/preview?size=", "size", {"0", "257", "-1", "1.5", ""}},
      {"GET", "/v1/volumes/VOLUME/preview?window=", "window", {"2,1"}},
      {"GET", "/v1/volumes/VOLUME/preview?", "axis", {"axis=x"}},
      {"GET", "/v1/volumes?", "order", {"order=size"}},
      {"GET", "/v1/estimate?", "volume", {"iso=1"}},
      {"GET", "/v1/estimate?volume=VOLUME", "iso", {"", "&iso=x", "&iso=1&iso=2"}},
      {"GET", "/v1/estimate?volume=VOLUME&iso=1&", "scheme", {"scheme=7"}},
      {"GET", "/v1/estimate?volume=VOLUME&iso=1&", "format", {"format=doc"}},
      {"GET", "/v1/jobs?", "state", {"state=melted"}},
      {"GET", "/v1/jobs?", "since", {"since=yesterday", "since=2026-02-30", "since="}},
      {"GET", "/v1/jobs?", "until", {"until=2026-11-20T07:30:00+01:00"}},
      {"GET", "/v1/jobs?limit=", "limit", {"0", "1001", "-1", "x", ""}},
      {"GET", "/v1/jobs/JOB?wait=", "wait", {"soon", "-1", "inf", "nan", "1e999", ""}},
      {"POST", "/v1/volumes?type=uint8&dims=", "dims", {"21,20,18", "4294967295,4294967295,9"}},
      {"POST", "/v1/volumes?", "dims", {"type=uint8"}},
      {"POST", "/v1/volumes?", "type", {"dims=21,20,19"}},
      {"POST", "/v1/volumes?RAW&spacing=", "spacing", {"0,1,1", "nan,1,1", "1,1,-1"}},
      {"POST", "/v1/volumes?RAW&", "direction", {"direction=1,0,0,1,0,0,1,0,0"}},
      {"POST", "/v1/volumes?", "series", {"series=nonsense"}},
      {"POST", "/v1/mesh?RAW&", "iso", {"passes=3", "iso=1&iso=2"}},
      {"POST", "/v1/mesh?RAW&iso=1&", "passes", {"passes=1001"}},
      {"POST", "/v1/mesh?RAW&iso=1&", "formats", {"formats=drc"}},
      {"POST", "/v1/mesh?RAW&iso=1&", "volume", {"volume=abc"}},
      {"POST", "/v1/mesh?RAW&iso=1&", "format", {"format=drc,stl", "format=exe"}},
      {"POST", "/v1/mesh?RAW&iso=1&", "position_bits", {"position_bits=31"}},
      {"POST", "/v1/mesh?RAW&iso=1&", "dims", {"dims=1,2,3"}},
  };
  return all;
}

class RefusalsTest : public testing::Test {
 protected:
  Answer ask(const std::string& method, std::string target) const {
    const std::string volume = job_.parameters.volume;
    for (const auto& [name, value] : std::vector<std::pair<std::string, std::string>>{
             {"VOLUME", volume}, {"JOB", job_.id}, {"RAW", sphere_.query}}) {
      const std::size_t at = target.find(name);
      if (at != std::string::npos) target.replace(at, name.size(), value);
    }
    return daemon_.send(method, target, method == "POST" ? sphere_.bytes : "");
  }

  Daemon daemon_;
  const RawUpload sphere_ = sphere_upload();
  const Job job_ = finished_job(daemon_);
};

TEST_F(RefusalsTest, NameTheParameterAndLeaveNothing) {
  for (const auto& [method, target, field, values] : all_wrong()) {
    for (const std::string& value : values) {
      EXPECT_TRUE(blames(ask(method, target + value), field)) << method << ' ' << target << value;
    }
  }
  EXPECT_EQ(daemon_.client().volumes().size(), 1U);
  EXPECT_EQ(daemon_.client().jobs().jobs.size(), 1U);
}

TEST_F(RefusalsTest, UnknownParametersAreRefusedEverywhere) {
  for (const std::string path : {"/v1/jobs", "/v1/volumes", "/v1/jobs/JOB", "/v1/volumes/VOLUME",
                                 "/v1/jobs/JOB/mesh.drc", "/v1/estimate"}) {
    EXPECT_TRUE(blames(ask("GET", path + "?flavour=sweet"), "flavour")) << path;
  }
  for (const std::string path : {"/v1/jobs/JOB", "/v1/volumes/VOLUME"}) {
    EXPECT_TRUE(blames(ask("DELETE", path + "?flavour=sweet"), "flavour")) << path;
  }
  for (const std::string path : {"/v1/jobs?", "/v1/mesh?iso=1&", "/v1/volumes?RAW&"}) {
    EXPECT_TRUE(blames(ask("POST", path + "flavour=sweet"), "flavour")) << path;
  }
}

}  // namespace
}  // namespace isomesh
