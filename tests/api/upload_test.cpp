// Volumes over HTTP: formats, digests, limits, and what is left of those that were refused.
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "proto/json.h"
#include "tests/api/daemon.h"
#include "tests/api/digest.h"
#include "tests/api/problems.h"
#include "tests/support/nifti.h"

namespace isomesh {
namespace {

using namespace test;
using testing::ElementsAre;
using testing::IsEmpty;

// A field of a form and the file in it.
std::string form(const std::string& name, const std::string& bytes) {
  return "--xyz\r\nContent-Disposition: form-data; name=\"" + name +
         "\"; filename=\"head.raw\"\r\nContent-Type: application/octet-stream\r\n\r\n" + bytes +
         "\r\n";
}
const Headers kForm = {{"Content-Type", "multipart/form-data; boundary=xyz"}};
const std::string kFormEnd = "--xyz--\r\n";

class UploadTest : public testing::Test {
 protected:
  Answer post(const std::string& body, const Headers& headers = {}) {
    return daemon_.send("POST", target_, body, headers);
  }

  std::size_t volumes() { return daemon_.client().volumes().size(); }

  // Volumes or parts of them in the daemon's folder, whatever it says.
  std::vector<std::string> files_left() {
    std::vector<std::string> files = files_below(daemon_.data());
    for (const auto* own : {"lock", "reserve", "blobs/identity"}) std::erase(files, own);
    std::erase_if(files,
                  [](const std::string& file) { return file.starts_with("isomesh.sqlite"); });
    return files;
  }

  Daemon daemon_;
  const RawUpload sphere_ = sphere_upload();
  const std::string target_ = "/v1/volumes?" + sphere_.query;
};

TEST_F(UploadTest, ANewVolumeIsCreated) {
  const Answer answer = post(sphere_.bytes);
  ASSERT_EQ(answer.status, 201);
  EXPECT_EQ(answer.header("content-type"), "application/json");
  const Volume volume = volume_from_json(answer.body);
  EXPECT_EQ(answer.header("location"), "/v1/volumes/" + volume.id);
  EXPECT_EQ(volume.format, "raw");
  EXPECT_EQ(volume.dims, (std::array<std::uint32_t, 3>{21, 20, 19}));
  EXPECT_EQ(volume.bytes, sphere_.bytes.size());
  EXPECT_EQ(volume.id.size(), 64U);
  EXPECT_EQ(volume_from_json(daemon_.get("/v1/volumes/" + volume.id).body), volume);
  EXPECT_THAT(daemon_.client().volumes(), ElementsAre(volume));
}

TEST_F(UploadTest, TheSameVolumeAgainIsTheSame) {
  const Answer first = post(sphere_.bytes);
  const Answer second = post(sphere_.bytes);
  EXPECT_EQ(second.status, 200);
  EXPECT_EQ(second.body, first.body);
  EXPECT_EQ(second.header("location"), first.header("location"));
  EXPECT_EQ(volumes(), 1U);
}

TEST_F(UploadTest, TakesTheWholeDescriptionOfRawSamples) {
  const Answer answer = daemon_.send(
      "POST",
      target_ + "&spacing=0.5,1,2&origin=-1,-2,3.5&direction=0,1,0,1,0,0,0,0,1&byte_order=big",
      sphere_.bytes);
  ASSERT_EQ(answer.status, 201) << answer.body;
  // The volume has its axes in the patient's order.
  const Volume volume = volume_from_json(answer.body);
  EXPECT_EQ(volume.stored_axes, "PLS");
  EXPECT_THAT(daemon_.command({"info", volume.id}).output,
              testing::ContainsRegex("axes in the file +PLS\n"));
  EXPECT_EQ(volume.geometry.spacing, (std::array<double, 3>{1, 0.5, 2}));
  EXPECT_EQ(volume.geometry.origin, (std::array<double, 3>{-1, -2, 3.5}));
  EXPECT_EQ(volume.geometry.direction, Geometry().direction);
}

// The names of transfer codings are case-insensitive (RFC 9112, 7).
TEST_F(UploadTest, ComesChunkedAsWell) {
  for (const std::string coding : {"chunked", "Chunked"}) {
    const Answer answer = answer_to(
        daemon_.url(), "POST " + target_ + " HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: " +
                           coding + "\r\n\r\n" + chunked(sphere_.bytes, 1000));
    EXPECT_LT(answer.status, 300) << answer.body;
  }
  EXPECT_EQ(post(sphere_.bytes).status, 200);
}

// Also without the line break after the form.
TEST_F(UploadTest, AFormComesChunkedAsWell) {
  const std::string whole = form("file", sphere_.bytes) + kFormEnd;
  for (const std::string& body : {whole, whole.substr(0, whole.rfind("\r\n"))}) {
    const Answer answer =
        answer_to(daemon_.url(), "POST " + target_ + " HTTP/1.1\r\nHost: localhost\r\n" +
                                     kForm.front().first + ": " + kForm.front().second +
                                     "\r\nTransfer-Encoding: chunked\r\n\r\n" + chunked(body, 999));
    EXPECT_LT(answer.status, 300) << answer.body;
  }
}

TEST_F(UploadTest, ComesAsAFormThatTellsItsFilesName) {
  const Answer answer = post(form("file", sphere_.bytes) + kFormEnd, kForm);
  ASSERT_EQ(answer.status, 201) << answer.body;
  EXPECT_EQ(volume_from_json(answer.body).name, "head.raw");
  EXPECT_EQ(post(sphere_.bytes).status, 200);
}

TEST_F(UploadTest, AFormComesWithAnyMediaTypeOfForms) {
  const std::string body = form("file", sphere_.bytes) + kFormEnd;
  for (const std::string type :
       {"multipart/form-data; boundary=xyz; charset=utf-8",
        "multipart/form-data; boundary=\"xyz\"; x=y", "multipart/form-data; Boundary=xyz",
        "Multipart/Form-Data;boundary=xyz",
        "multipart/form-data; x=\"; boundary=no\"; boundary=xyz"}) {
    EXPECT_LT(post(body, {{"Content-Type", type}}).status, 300) << type;
  }
  for (const std::string type : {"multipart/form-data", "multipart/form-data; charset=utf-8"}) {
    EXPECT_TRUE(blames(post(body, {{"Content-Type", type}}), "Content-Type")) << type;
  }
}

// A line break after the last boundary is not required (RFC 2046, 5.1.1).
TEST_F(UploadTest, AFormMayEndWithItsBoundary) {
  const std::string file = form("file", sphere_.bytes);
  for (const std::string end :
       {"--xyz--", "--xyz--\r\n", "--xyz--\r\n\r\n", "--xyz--\r\nand more"}) {
    EXPECT_LT(post(file + end, kForm).status, 300) << end;
  }
  EXPECT_EQ(volumes(), 1U);
}

TEST_F(UploadTest, AFormWithoutItsLastBoundarySaysSo) {
  const std::string file = form("file", sphere_.bytes);
  for (const std::string& wrong : {file, file + "--xyz", file + "--xyz-", "--abc" + file}) {
    const Answer answer = post(wrong, kForm);
    EXPECT_TRUE(is_problem(answer, ErrorCode::kInvalidParameter));
    EXPECT_THAT(answer.body, testing::HasSubstr("boundary in Content-Type"));
  }
}

// The body has no end, so only a limit can refuse it.
TEST_F(UploadTest, WhatIsBesideTheFileOfAFormIsBounded) {
  const std::string beside(2 << 20, 'x');
  for (const std::string& begin : {form("file", sphere_.bytes) + "--xyz", std::string("--xyz")}) {
    const std::string body = chunked(begin + beside, 1 << 20);
    const Answer answer =
        answer_to(daemon_.url(), "POST " + target_ + " HTTP/1.1\r\nHost: localhost\r\n" +
                                     kForm.front().first + ": " + kForm.front().second +
                                     "\r\nTransfer-Encoding: chunked\r\n\r\n" +
                                     body.substr(0, body.rfind("0\r\n\r\n")));
    EXPECT_TRUE(is_problem(answer, ErrorCode::kInvalidParameter)) << answer.body;
  }
}

TEST_F(UploadTest, AFormOfAnythingElseIsRefused) {
  const std::string file = form("file", sphere_.bytes);
  EXPECT_TRUE(blames(post(form("volume", sphere_.bytes) + kFormEnd, kForm), "file"));
  EXPECT_TRUE(blames(post(file + file + kFormEnd, kForm), "file"));
  EXPECT_TRUE(blames(post(file + form("note", "x") + kFormEnd, kForm), "file"));
  EXPECT_TRUE(is_problem(post(kFormEnd, kForm), ErrorCode::kInvalidParameter));
  EXPECT_TRUE(is_problem(post("no form at all", kForm), ErrorCode::kInvalidParameter));
  EXPECT_TRUE(is_problem(post(form("file", ""), kForm), ErrorCode::kInvalidParameter));
  EXPECT_EQ(volumes(), 0U);
  EXPECT_THAT(files_left(), IsEmpty());
}

TEST_F(UploadTest, ADigestIsChecked) {
  EXPECT_TRUE(is_problem(post(sphere_.bytes, {{"Content-Digest", digest_of("another body")}}),
                         ErrorCode::kDigestMismatch));
  EXPECT_EQ(volumes(), 0U);
  EXPECT_THAT(files_left(), IsEmpty());
  EXPECT_EQ(post(sphere_.bytes, {{"Content-Digest", digest_of(sphere_.bytes)}}).status, 201);
}

TEST_F(UploadTest, WhatIsNoVolumeIsUnsupported) {
  for (const std::string& body : {std::string("hello"), std::string(100'000, 'x'),
                                  std::string(1000, '\0'), std::string("%PDF-1.4 and so on")}) {
    EXPECT_TRUE(
        is_problem(daemon_.send("POST", "/v1/volumes", body), ErrorCode::kUnsupportedMedia));
  }
  EXPECT_TRUE(is_problem(daemon_.send("POST", "/v1/volumes", "PK\3\4 and no more"),
                         ErrorCode::kUnusableVolume));
  EXPECT_THAT(files_left(), IsEmpty());
}

TEST_F(UploadTest, AnEmptyBodyIsRefused) {
  EXPECT_TRUE(is_problem(post(""), ErrorCode::kInvalidParameter));
  EXPECT_TRUE(is_problem(daemon_.send("POST", "/v1/volumes", ""), ErrorCode::kInvalidParameter));
}

TEST_F(UploadTest, ATruncatedVolumeIsUnusable) {
  const std::string brain = read_file(kBrainFile);
  for (const std::size_t bytes : {std::size_t{400}, brain.size() / 2, brain.size() - 9}) {
    EXPECT_TRUE(is_problem(daemon_.send("POST", "/v1/volumes", brain.substr(0, bytes)),
                           ErrorCode::kUnusableVolume))
        << bytes;
  }
  EXPECT_EQ(volumes(), 0U);
  EXPECT_THAT(files_left(), IsEmpty());
}

TEST_F(UploadTest, CutAtHalfLeavesNothing) {
  {
    const Connection connection(daemon_.url());
    const std::string bytes(128 * 128 * 128, 'x');  // too many to be waited for in memory
    const std::string whole = request("POST", "/v1/volumes?dims=128,128,128&type=uint8", bytes);
    connection.send(std::string_view(whole).substr(0, whole.size() - bytes.size() / 2));
    ASSERT_TRUE(eventually([&] { return !files_left().empty(); }));
    EXPECT_EQ(volumes(), 0U);
  }
  EXPECT_TRUE(eventually([&] { return files_left().empty(); }));
  EXPECT_EQ(volumes(), 0U);
}

TEST_F(UploadTest, ABrokenChunkIsRefused) {
  const Connection connection(daemon_.url());
  connection.send(
      "POST " + target_ +
      " HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\nabc\r\n");
  EXPECT_TRUE(is_problem(connection.receive(), ErrorCode::kInvalidParameter));
  EXPECT_TRUE(eventually([&] { return files_left().empty(); }));
}

TEST_F(UploadTest, AnErasedVolumeIsGone) {
  const std::string path = "/v1/volumes/" + upload(daemon_, sphere_).id;
  EXPECT_EQ(daemon_.send("DELETE", path).status, 204);
  EXPECT_TRUE(is_problem(daemon_.get(path), ErrorCode::kNotFound));
  EXPECT_TRUE(is_problem(daemon_.send("DELETE", path), ErrorCode::kNotFound));
  EXPECT_TRUE(eventually([&] { return files_left().empty(); }));
}

TEST_F(UploadTest, AVolumeThatAJobNeedsIsKept) {
  const Job job = long_job(daemon_);
  const std::string path = "/v1/volumes/" + job.parameters.volume;
  EXPECT_TRUE(is_problem(daemon_.send("DELETE", path), ErrorCode::kNotReady));
  EXPECT_EQ(daemon_.get(path).status, 200);
  daemon_.client().cancel(job.id);
}

TEST(UploadLimit, HoldsForEveryWayToSend) {
  const Daemon daemon(std::vector<std::string>{"--max-upload", "5000"});
  const RawUpload sphere = sphere_upload();
  const std::string target = "/v1/volumes?" + sphere.query;
  EXPECT_TRUE(is_problem(daemon.send("POST", target, sphere.bytes), ErrorCode::kTooLarge));
  EXPECT_TRUE(is_problem(
      answer_to(daemon.url(),
                "POST " + target +
                    " HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n" +
                    chunked(sphere.bytes, 100)),
      ErrorCode::kTooLarge));
  EXPECT_TRUE(is_problem(daemon.send("POST", target, form("file", sphere.bytes) + kFormEnd, kForm),
                         ErrorCode::kTooLarge));
  // Refused for what it announces, before any of it has come.
  EXPECT_TRUE(is_problem(answer_to(daemon.url(), "POST " + target +
                                                     " HTTP/1.1\r\nHost: localhost\r\n"
                                                     "Content-Length: 99999999999999\r\n\r\n"),
                         ErrorCode::kTooLarge));
  EXPECT_EQ(
      daemon.send("POST", "/v1/volumes?dims=10,10,50&type=uint8", std::string(5000, 'x')).status,
      201);
}

TEST(VolumeLimit, HoldsForTheSamples) {
  const Daemon daemon(std::vector<std::string>{"--max-volume", "5000"});
  const RawUpload sphere = sphere_upload();
  EXPECT_TRUE(is_problem(daemon.send("POST", "/v1/volumes?" + sphere.query, sphere.bytes),
                         ErrorCode::kTooLarge));
}

TEST(Uploads, OfManyClientsAtATimeAreAllKept) {
  const Daemon daemon;
  std::vector<std::jthread> clients;
  std::atomic<int> created = 0;
  for (int client = 0; client < 8; ++client) {
    clients.emplace_back([&, client] {
      const std::string bytes(1000, static_cast<char>('a' + client));
      if (daemon.send("POST", "/v1/volumes?dims=10,10,10&type=uint8", bytes).status == 201) {
        ++created;
      }
    });
  }
  clients.clear();
  EXPECT_EQ(created, 8);
  EXPECT_EQ(daemon.client().volumes().size(), 8U);
}

}  // namespace
}  // namespace isomesh
