// Meshes over HTTP: the bytes, parts of them, and all in one request.
#include <cstring>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/json.h"
#include "proto/parameters.h"
#include "tests/api/daemon.h"
#include "tests/api/digest.h"
#include "tests/api/problems.h"
#include "tests/support/draco_decoder.h"

namespace isomesh {
namespace {

using namespace test;
using testing::EndsWith;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

class MeshTest : public testing::Test {
 protected:
  Answer get(const Headers& headers = {}) { return daemon_.get(path_, headers); }
  Answer range(const std::string& value) { return get({{"Range", value}}); }

  Daemon daemon_;
  const Job job_ = finished_job(daemon_, R"("formats": ["drc", "stl"])");
  const std::string path_ = "/v1/jobs/" + job_.id + "/mesh.stl";
  const MeshFile file_ = job_.mesh->files.at(MeshFormat::kStl);
  const std::string bytes_ = get().body;
};

TEST_F(MeshTest, IsWhatTheJobDescribes) {
  const Answer answer = get();
  EXPECT_EQ(answer.status, 200);
  EXPECT_EQ(answer.body.size(), file_.bytes);
  EXPECT_EQ(answer.header("content-length"), std::to_string(file_.bytes));
  EXPECT_EQ(answer.header("etag"), '"' + file_.sha256 + '"');
  EXPECT_EQ(answer.header("cache-control"), "private, immutable");
  EXPECT_EQ(answer.header("content-type"), "model/stl");
  EXPECT_EQ(answer.header("accept-ranges"), "bytes");
  EXPECT_THAT(answer.header("content-disposition"), HasSubstr("mesh.stl"));
  std::uint32_t triangles = 0;
  std::memcpy(&triangles, answer.body.data() + 80, sizeof triangles);
  EXPECT_EQ(triangles, job_.mesh->triangles);
}

TEST_F(MeshTest, DracoHasNoMediaTypeOfItsOwn) {
  const Answer answer = daemon_.get("/v1/jobs/" + job_.id + "/mesh.drc");
  EXPECT_EQ(answer.header("content-type"), "application/octet-stream");
  EXPECT_THAT(answer.header("content-disposition"), HasSubstr("mesh.drc"));
  const DecodedMesh decoded = decode_with_command(answer.body);
  EXPECT_EQ(decoded.triangles.size(), job_.mesh->triangles);
  EXPECT_EQ(decoded.points.size(), job_.mesh->vertices);
}

TEST_F(MeshTest, TellsItsTimings) {
  const std::string timing = get().header("server-timing");
  std::size_t last = 0;
  for (const std::string stage : {"queue", "load", "extract", "smooth", "untangle", "simplify",
                                  "encode", "certify", "thickness", "total"}) {
    const std::size_t found = timing.find(stage + ";dur=");
    ASSERT_NE(found, std::string::npos) << timing;
    EXPECT_GE(found, last);
    const bool has_run =
        stage != "untangle" && stage != "simplify" && stage != "certify" && stage != "thickness";
    EXPECT_EQ(std::stod(timing.substr(found + stage.size() + 5)) > 0, has_run) << stage;
    last = found;
  }
}

TEST_F(MeshTest, TellsTheThinnestWallThatIsAskedFor) {
  EXPECT_FALSE(job_.mesh->thickness);
  const Job job = finished_job(daemon_, R"("formats": ["stl"], "min_thickness_mm": 500)");
  EXPECT_EQ(job.mesh->files.at(MeshFormat::kStl).sha256, file_.sha256);
  const Thickness& thickness = job.mesh->thickness.value();
  EXPECT_GT(thickness.thinnest_mm.value(), 0.5);
  EXPECT_GT(thickness.thin_area_mm2, 0);
  EXPECT_GT(job.timing.thickness, 0);
  const Answer answer = daemon_.send(
      "POST", "/v1/jobs", job_body(job.parameters.volume, 100, R"("min_thickness_mm": 0)"));
  EXPECT_TRUE(is_problem(answer, ErrorCode::kInvalidParameter));
  EXPECT_THAT(answer.body, HasSubstr("min_thickness_mm"));
}

TEST_F(MeshTest, AFormatThatWasNotAskedForIsNotFound) {
  EXPECT_TRUE(is_problem(daemon_.get("/v1/jobs/" + job_.id + "/mesh.glb"), ErrorCode::kNotFound));
}

TEST_F(MeshTest, IsNotSentTwice) {
  const std::string etag = get().header("etag");
  for (const std::string& value : {etag, "W/" + etag, "\"other\", " + etag, std::string("*")}) {
    const Answer answer = get({{"If-None-Match", value}});
    EXPECT_EQ(answer.status, 304) << value;
    EXPECT_TRUE(answer.body.empty());
    EXPECT_EQ(answer.header("etag"), etag);
  }
  for (const std::string value : {"\"other\"", "", "abc"}) {
    EXPECT_EQ(get({{"If-None-Match", value}}).status, 200) << value;
  }
}

TEST_F(MeshTest, HeadIsGetWithoutTheBytes) {
  const Answer head = daemon_.send("HEAD", path_);
  const Answer whole = get();
  EXPECT_EQ(head.status, 200);
  EXPECT_TRUE(head.body.empty());
  EXPECT_EQ(head.header("content-length"), whole.header("content-length"));
  EXPECT_EQ(head.header("etag"), whole.header("etag"));
  EXPECT_EQ(daemon_.send("HEAD", "/v1/jobs/" + job_.id).status, 200);
  EXPECT_EQ(daemon_.send("HEAD", "/v1/jobs/0123").status, 404);
}

// RFC 9110, 14.2: a range is for GET alone.
TEST_F(MeshTest, HeadHasNoRanges) {
  const Answer head = daemon_.send("HEAD", path_, {}, {{"Range", "bytes=0-9"}});
  EXPECT_EQ(head.status, 200);
  EXPECT_EQ(head.header("content-length"), std::to_string(bytes_.size()));
}

TEST_F(MeshTest, GivesAnyPart) {
  struct Part {
    std::string range;
    std::size_t first;
    std::size_t length;
  };
  const std::size_t size = bytes_.size();
  const std::string last = std::to_string(size - 1);
  for (const Part& part :
       {Part{"bytes=0-0", 0, 1}, Part{"bytes=0-99", 0, 100}, Part{"bytes=80-83", 80, 4},
        Part{"bytes=-1", size - 1, 1}, Part{"bytes=" + last + "-", size - 1, 1},
        Part{"bytes=0-", 0, size}, Part{"bytes=10-99999999", 10, size - 10},
        Part{"bytes=-99999999", 0, size}}) {
    SCOPED_TRACE(part.range);
    const Answer answer = range(part.range);
    EXPECT_EQ(answer.status, 206);
    EXPECT_TRUE(answer.body == bytes_.substr(part.first, part.length));
    EXPECT_EQ(answer.header("content-length"), std::to_string(part.length));
    EXPECT_EQ(answer.header("content-range"), "bytes " + std::to_string(part.first) + '-' +
                                                  std::to_string(part.first + part.length - 1) +
                                                  '/' + std::to_string(size));
    EXPECT_EQ(answer.header("etag"), '"' + file_.sha256 + '"');
  }
}

TEST_F(MeshTest, APartOutsideOfItIsNotSatisfiable) {
  for (const std::string& value : {"bytes=" + std::to_string(bytes_.size()) + "-",
                                   std::string("bytes=99999999-"), std::string("bytes=-0")}) {
    const Answer answer = range(value);
    EXPECT_TRUE(is_problem(answer, ErrorCode::kRangeNotSatisfiable)) << value;
    // RFC 9110, 15.5.17: so that the client learns what it may ask for.
    EXPECT_EQ(answer.header("content-range"), "bytes */" + std::to_string(bytes_.size())) << value;
  }
}

TEST_F(MeshTest, SeveralRangesAreTheWholeFile) {
  std::string many = "bytes=0-0";
  for (int n = 0; n < 800; ++n) many += ",0-999";
  for (const std::string& value : {std::string("bytes=0-9,20-29"), many}) {
    const Answer answer = range(value);
    EXPECT_EQ(answer.status, 200);
    EXPECT_TRUE(answer.body == bytes_);
  }
}

// RFC 9110, 14.2: what is no range is ignored.
TEST_F(MeshTest, RangesThatAreNoneAreTheWholeFile) {
  for (const std::string& value :
       {std::string("items=0-5"), std::string("bytes=9-5"), std::string("bytes=a-b"),
        std::string("bytes=-"), std::string("bytes="), std::string("bytes"), std::string("=0-5"),
        std::string("bytes=99999999999999999999999-"), std::string("bytes=--5"),
        "bytes=" + std::string(7000, '1') + "-"}) {
    const Answer answer = range(value);
    EXPECT_EQ(answer.status, 200) << value.substr(0, 60);
    EXPECT_TRUE(answer.body == bytes_) << value.substr(0, 60);
  }
  EXPECT_EQ(range("bytes=0-18446744073709551615").status, 206);
  EXPECT_TRUE(is_problem(range("bytes=18446744073709551615-"), ErrorCode::kRangeNotSatisfiable));
}

TEST_F(MeshTest, SaysItsDigestAndTakesPreconditions) {
  const Answer whole = get({});
  EXPECT_EQ(whole.header("repr-digest"), digest_of(bytes_));
  EXPECT_EQ(range("bytes=0-9").header("repr-digest"), digest_of(bytes_));
  EXPECT_EQ(get({{"If-Match", whole.header("etag")}}).status, 200);
  EXPECT_EQ(get({{"If-Match", "*"}}).status, 200);
  EXPECT_TRUE(is_problem(get({{"If-Match", "\"other\""}}), ErrorCode::kPreconditionFailed));
}

// RFC 9110, 13.1.5: with another version's validator the whole file is due.
TEST_F(MeshTest, ARangeOfAnotherVersionIsTheWholeFile) {
  const std::string etag = '"' + file_.sha256 + '"';
  EXPECT_EQ(get({{"Range", "bytes=0-9"}, {"If-Range", etag}}).status, 206);
  EXPECT_EQ(get({{"Range", "bytes=0-9"}, {"If-Range", "\"other\""}}).status, 200);
}

// --- In one request ------------------------------------------------------------------------------

class MeshInOne : public testing::Test {
 protected:
  Answer post(const std::string& query, const std::string& body) {
    return daemon_.send("POST", "/v1/mesh?" + query, body);
  }
  Answer post(const std::string& query) { return post(sphere_.query + '&' + query, sphere_.bytes); }

  Daemon daemon_;
  const RawUpload sphere_ = sphere_upload();
};

TEST_F(MeshInOne, GivesTheMeshOfTheJob) {
  const Answer answer = post("iso=100");
  ASSERT_EQ(answer.status, 200) << answer.body;
  const Job job = job_from_json(daemon_.get(answer.header("location")).body);
  EXPECT_EQ(job.state, JobState::kSucceeded);
  EXPECT_EQ(answer.header("etag"), '"' + job.mesh->files.at(MeshFormat::kDrc).sha256 + '"');
  EXPECT_THAT(answer.header("server-timing"), HasSubstr("extract;dur="));
  EXPECT_EQ(decode_with_command(answer.body).triangles.size(), job.mesh->triangles);
  EXPECT_TRUE(daemon_.get(answer.header("location") + "/mesh.drc").body == answer.body);
}

TEST_F(MeshInOne, TakesEveryParameter) {
  const Answer answer = post(
      "iso=100&scheme=5&interpolation=midpoint&passes=2&smoothing=taubin&lambda=0.5"
      "&pass_band=0.05&max_displacement_mm=0.25"
      "&close=false&format=stl&position_bits=11&speed=5&priority=stat&spacing=1,1,2");
  ASSERT_EQ(answer.status, 200) << answer.body;
  EXPECT_EQ(answer.header("content-type"), "model/stl");
  const Job job = job_from_json(daemon_.get(answer.header("location")).body);
  EXPECT_EQ(job.parameters.scheme, SchemeName::kFive);
  EXPECT_EQ(job.parameters.interpolation, Interpolation::kMidpoint);
  EXPECT_EQ(job.parameters.passes, 2);
  EXPECT_EQ(job.parameters.smoothing, Smoothing::kTaubin);
  EXPECT_EQ(job.parameters.lambda, 0.5);
  EXPECT_EQ(job.parameters.pass_band, 0.05);
  EXPECT_EQ(job.parameters.max_displacement_mm, 0.25);
  EXPECT_LE(job.mesh->displacement_mm.max, 0.25);
  EXPECT_EQ(job.parameters.draco, (DracoParameters{11, 5}));
  EXPECT_EQ(job.parameters.priority, Priority::kStat);
}

TEST_F(MeshInOne, TakesOtsu) {
  const Answer answer = post("iso=otsu");
  ASSERT_EQ(answer.status, 200) << answer.body;
  const Job job = job_from_json(daemon_.get(answer.header("location")).body);
  EXPECT_EQ(job.parameters.iso, std::nullopt);
  EXPECT_GT(job.mesh->triangles, 0U);
}

TEST_F(MeshInOne, IgnoresConditionsAndRanges) {
  const Answer answer = daemon_.send("POST", "/v1/mesh?iso=100&" + sphere_.query, sphere_.bytes,
                                     {{"Range", "bytes=0-9"}});
  EXPECT_EQ(answer.status, 200);
  EXPECT_GT(answer.body.size(), 10U);
}

TEST_F(MeshInOne, RefusesWhatIsNoVolume) {
  EXPECT_TRUE(is_problem(post("iso=1", "garbage"), ErrorCode::kUnsupportedMedia));
  EXPECT_TRUE(is_problem(post("iso=1", ""), ErrorCode::kInvalidParameter));
  EXPECT_TRUE(daemon_.client().jobs().jobs.empty());
}

// --- Without a surface ---------------------------------------------------------------------------

constexpr std::size_t kEmptyStlBytes = 84;

RawUpload all_of(std::uint8_t value) {
  return raw_upload(
      sample<std::uint8_t>([value](const Point& /*point*/) -> double { return value; }, {4, 4, 4}));
}

TEST_F(MeshInOne, AnEmptySurfaceIsAnErrorUnlessItIsAccepted) {
  const double iso =
      volume_from_json(daemon_.send("POST", "/v1/volumes?" + sphere_.query, sphere_.bytes).body)
          .suggested_iso;
  const std::string suggests = "its suggested iso-value is " + number_text(iso);
  struct Way {
    RawUpload raw;
    std::string query;
    std::string reason;
  };
  for (const Way& way :
       {Way{sphere_, "iso=1000", suggests}, Way{sphere_, "iso=1000&close=true", suggests},
        Way{sphere_, "iso=-5", "separates none of the samples of the volume, which range from "},
        Way{sphere_, "iso=100&crop=0,0,0,2,2,2", "in the box of crop; those of the volume range"},
        Way{sphere_, "iso=100&min_triangles=1000000", "its only connected component was dropped"},
        Way{all_of(7), "iso=otsu", "which range from 7 to 7; allow_empty"},
        Way{all_of(1), "labels=1", "the chosen labels have no boundary; close adds"}}) {
    SCOPED_TRACE(way.query);
    const std::string query = way.raw.query + "&format=stl&" + way.query;
    const Answer refused = post(query, way.raw.bytes);
    ASSERT_TRUE(is_problem(refused, ErrorCode::kEmptySurface));
    const std::string detail = problem_from_json(refused.body).detail;
    EXPECT_THAT(detail, StartsWith("the surface is empty: "));
    EXPECT_THAT(detail, HasSubstr(way.reason));
    EXPECT_THAT(detail, EndsWith("; allow_empty=true accepts that"));
    const std::string job = refused.header("location");
    const Job made = job_from_json(daemon_.get(job).body);
    EXPECT_EQ(made.state, JobState::kSucceeded);
    EXPECT_TRUE(made.mesh->empty);
    EXPECT_THAT(detail, HasSubstr(made.mesh->empty_reason.value()));
    EXPECT_EQ(daemon_.get(job + "/mesh.stl").body.size(), kEmptyStlBytes);
    const Answer accepted = post(query + "&allow_empty=true", way.raw.bytes);
    EXPECT_EQ(accepted.status, 200) << accepted.body;
    EXPECT_EQ(accepted.body.size(), kEmptyStlBytes);
  }
}

TEST_F(MeshInOne, ASurfaceThatIsThereHasNoReason) {
  for (const std::string query : {"iso=100", "iso=100&allow_empty=true", "iso=-5&close=true"}) {
    const Answer answer = post(query);
    ASSERT_EQ(answer.status, 200) << query << answer.body;
    const std::string job = daemon_.get(answer.header("location")).body;
    EXPECT_THAT(job, Not(HasSubstr("empty_reason"))) << query;
  }
  EXPECT_TRUE(blames(post("iso=100&allow_empty=yes"), "allow_empty"));
  EXPECT_TRUE(blames(post("iso=100&allow_empty=true&allow_empty=false"), "allow_empty"));
}

// Its first response may be followed by the mesh, without another upload's job.
TEST_F(MeshInOne, AKeyMayComeAgainWithWhatItAllows) {
  const Headers key = {{"Idempotency-Key", "k"}};
  const std::string target = "/v1/mesh?iso=1000&format=stl&" + sphere_.query;
  const Answer refused = daemon_.send("POST", target, sphere_.bytes, key);
  ASSERT_TRUE(is_problem(refused, ErrorCode::kEmptySurface));
  const Answer accepted = daemon_.send("POST", target + "&allow_empty=true", sphere_.bytes, key);
  EXPECT_EQ(accepted.status, 200);
  EXPECT_EQ(accepted.header("location"), refused.header("location"));
}

}  // namespace
}  // namespace isomesh
