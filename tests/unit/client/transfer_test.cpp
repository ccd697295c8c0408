// Files on their way to the server, and meshes on theirs back.
#include <atomic>
#include <future>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>

#include "base/base64.h"
#include "base/sha256.h"
#include "client/isomesh/client.h"
#include "proto/json.h"
#include "tests/unit/client/support.h"

namespace isomesh {
namespace {

using test::answer_with;
using test::error_of;
using test::FakeServer;
using test::finished_job;
using test::pattern;
using test::some_volume;
using test::TemporaryFolder;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr const char* kJson = "application/json";
const UploadOptions kInOnePiece = {.resumable_bytes = UINT64_MAX};

class Upload : public testing::Test {
 protected:
  // A file with that content.
  std::filesystem::path file(const std::string& content) const {
    test::write_file(folder_ / "file", content);
    return folder_ / "file";
  }

  const TemporaryFolder folder_;
};

TEST_F(Upload, SendsTheFileInPiecesWithItsLengthAndReportsEachOfThem) {
  const std::string content = pattern(3'000'001);
  FakeServer server;
  std::string received;
  httplib::Headers headers;
  std::size_t largest = 0;
  server.http.Post("/v1/volumes", [&](const httplib::Request& request, httplib::Response& response,
                                      const httplib::ContentReader& read) {
    headers = request.headers;
    read([&](const char* data, std::size_t size) {
      received.append(data, size);
      return true;
    });
    response.set_content(to_json(some_volume()), kJson);
    response.status = 201;
  });

  std::uint64_t last = 0;
  UploadOptions options{.digest = true};
  options.progress = [&](std::uint64_t done, std::uint64_t total) {
    EXPECT_EQ(total, content.size());
    EXPECT_GE(done, last);
    largest = std::max<std::size_t>(largest, done - last);
    last = done;
  };
  Client client({.server = server.start(), .token = "secret"});
  EXPECT_EQ(client.upload(file(content), options), some_volume());

  EXPECT_TRUE(received == content);
  EXPECT_EQ(last, content.size());
  EXPECT_LT(largest, std::size_t{1'000'000});
  EXPECT_EQ(headers.find("Content-Length")->second, std::to_string(content.size()));
  EXPECT_EQ(headers.find("Authorization")->second, "Bearer secret");
  EXPECT_THAT(headers.find("User-Agent")->second, testing::StartsWith("isomesh/"));
  Sha256 sha256;
  sha256.update(content);
  EXPECT_EQ(headers.find("Content-Digest")->second, "sha-256=:" + to_base64(sha256.finish()) + ":");
}

TEST_F(Upload, OfAnEmptyFileReachesTheServer) {
  FakeServer server;
  server.http.Post("/v1/volumes", [](const httplib::Request&, httplib::Response& response) {
    answer_with(response, Error(ErrorCode::kUnsupportedMedia, "the body is empty"));
  });
  Client client({.server = server.start()});
  EXPECT_EQ(error_of([&] { client.upload(file("")); }).code(), ErrorCode::kUnsupportedMedia);
}

TEST_F(Upload, DescribesRawSamplesInTheQuery) {
  FakeServer server;
  httplib::Params seen;
  std::string target;
  server.http.Post("/v1/volumes", [&](const httplib::Request& request, httplib::Response& response,
                                      const httplib::ContentReader& read) {
    seen = request.params;
    target = request.target;
    read([](const char*, std::size_t) { return true; });
    response.set_content(to_json(some_volume()), kJson);
  });

  UploadOptions options;
  options.raw = RawDescription{.dims = {2, 3, 4},
                               .type = SampleType::kInt16,
                               .geometry = {.origin = {-90, 0, 1.5},
                                            .spacing = {0.7, 0.1, 1e-7},
                                            .direction = {0, 1, 0, 1, 0, 0, 0, 0, -1}},
                               .big_endian = true};
  Client client({.server = server.start()});
  client.upload(file(pattern(48)), options);

  EXPECT_EQ(seen.find("dims")->second, "2,3,4");
  EXPECT_EQ(seen.find("type")->second, "int16");
  EXPECT_EQ(seen.find("spacing")->second, "0.7,0.1,1e-07");
  EXPECT_EQ(seen.find("origin")->second, "-90,0,1.5");
  EXPECT_EQ(seen.find("direction")->second, "0,1,0,1,0,0,0,0,-1");
  EXPECT_EQ(seen.find("byte_order")->second, "big");
  EXPECT_THAT(target, HasSubstr("dims=2%2C3%2C4"));
}

// A large upload without a token fails with the server's reason, not with a broken pipe.
TEST_F(Upload, HearsARefusalThatComesBeforeTheBodyWasTaken) {
  test::SocketServer server([](int socket) {
    test::read_head(socket);
    test::answer(socket,
                 "401 Unauthorized\r\nContent-Type: application/problem+json\r\nConnection: close",
                 to_json(to_problem(Error(ErrorCode::kUnauthorized, "no token"), "")));
  });
  Client client({.server = server.url()});
  const Error error = error_of([&] { client.upload(file(pattern(20'000'000))); });
  EXPECT_EQ(error.code(), ErrorCode::kUnauthorized);
  EXPECT_STREQ(error.what(), "no token");
  EXPECT_EQ(server.connections(), 1);
}

// It waits for a second, in which a server that stands still does not refuse it.
TEST_F(Upload, SendsNothingOfALargeBodyThatIsRefusedByItsHead) {
  const auto bytes_sent_in_vain = [&] {
    std::promise<std::size_t> received;
    test::SocketServer server([&](int socket) {
      EXPECT_THAT(test::read_head(socket), HasSubstr("Content-Length: 20000000\r\n"));
      test::answer(socket, "401 Unauthorized");
      received.set_value(test::read_to_the_end(socket));
    });
    Client client({.server = server.url()});
    EXPECT_EQ(error_of([&] { client.upload(file(pattern(20'000'000)), kInOnePiece); }).code(),
              ErrorCode::kUnauthorized);
    return received.get_future().get();
  };
  EXPECT_TRUE(test::eventually([&] { return bytes_sent_in_vain() == 0; }));
}

TEST_F(Upload, StopsWhereARefusalComesInTheMiddle) {
  constexpr std::size_t kBytes = 50'000'000;
  std::promise<std::size_t> received;
  test::SocketServer server([&](int socket) {
    test::read_head(socket);
    test::send_text(socket, "HTTP/1.1 100 Continue\r\n\r\n");
    std::string begin(1'000'000, ' ');
    EXPECT_EQ(::recv(socket, begin.data(), begin.size(), MSG_WAITALL), 1'000'000);
    test::answer(socket, "507 Full");
    received.set_value(test::read_to_the_end(socket));
  });
  Client client({.server = server.url()});
  EXPECT_EQ(error_of([&] { client.upload(file(pattern(kBytes)), kInOnePiece); }).code(),
            ErrorCode::kOutOfSpace);
  EXPECT_LT(received.get_future().get(), kBytes / 2);
}

TEST_F(Upload, GoesOnWhereTheConnectionBrokeAndAsksForAnAnswerThatItDidNotHear) {
  const std::string content = pattern(200'000);
  std::string received;
  std::vector<std::string> asked;
  const test::SocketServer server([&](int socket) {
    const std::string head = test::read_head(socket);
    asked.push_back(head.substr(0, head.find(" HTTP")));
    if (head.starts_with("POST") && head.find("upload=") == std::string::npos) {
      EXPECT_THAT(head, HasSubstr("Upload-Length: 200000\r\n"));
      EXPECT_THAT(head, HasSubstr("Repr-Digest: sha-256=:"));
      // Absolute, as some proxies make it.
      return test::answer(socket, "201 Created\r\nLocation: http://inside:8080/v1/uploads/7");
    }
    if (head.starts_with("POST")) return test::answer(socket, "200 OK", to_json(some_volume()));
    if (head.starts_with("HEAD")) {
      const bool is_whole = received.size() == content.size();
      return test::send_text(
          socket, "HTTP/1.1 204 No Content\r\nUpload-Offset: " + std::to_string(received.size()) +
                      "\r\nUpload-Complete: " + (is_whole ? "?1" : "?0") + "\r\n\r\n");
    }
    EXPECT_THAT(head, HasSubstr("Upload-Offset: " + std::to_string(received.size()) + "\r\n"));
    std::string part(std::min<std::size_t>(120'000, content.size() - received.size()), ' ');
    ::recv(socket, part.data(), part.size(), MSG_WAITALL);
    received += part;
  });
  Client client({.server = server.url()});
  EXPECT_EQ(client.upload(file(content), {.digest = true, .resumable_bytes = 1000}), some_volume());
  EXPECT_TRUE(received == content);
  EXPECT_THAT(
      asked, ElementsAre("POST /v1/volumes", "PATCH /v1/uploads/7", "HEAD /v1/uploads/7",
                         "PATCH /v1/uploads/7", "HEAD /v1/uploads/7", "POST /v1/volumes?upload=7"));
}

TEST_F(Upload, GoesOnWhereTheConnectionStalls) {
  const std::string content = pattern(20'000'000);
  int stalled = -1;
  bool is_whole = false;
  const test::SocketServer server([&](int socket) {
    const std::string head = test::read_head(socket);
    if (head.starts_with("HEAD")) {
      return test::send_text(
          socket, "HTTP/1.1 204 No Content\r\nUpload-Offset: 0\r\nUpload-Complete: ?0\r\n\r\n");
    }
    if (head.starts_with("POST"))
      return test::answer(socket, "201 Created\r\nLocation: /v1/uploads/7");
    if (stalled < 0) {
      stalled = ::dup(socket);  // open, and nobody reads what comes
      return;
    }
    std::string body(content.size(), ' ');
    ::recv(socket, body.data(), body.size(), MSG_WAITALL);
    is_whole = body == content;
    test::answer(socket, "201 Created", to_json(some_volume()));
  });
  Client client({.server = server.url(), .stall_timeout = std::chrono::milliseconds{1500}});
  EXPECT_EQ(client.upload(file(content)), some_volume());
  EXPECT_TRUE(is_whole);
  ::close(stalled);
}

// As of another daemon of a cluster, or when it has expired.
TEST_F(Upload, InPartsIsSentInOnePieceWhereItIsNotKept) {
  std::vector<std::string> asked;
  const test::SocketServer server([&](int socket) {
    const std::string head = test::read_head(socket);
    asked.push_back(head.substr(0, head.find(' ')));
    if (asked.size() == 1) return test::answer(socket, "201 Created\r\nLocation: /v1/uploads/7");
    if (asked.size() == 2) return;  // the connection breaks
    if (asked.size() == 3) return test::answer(socket, "410 Gone");
    EXPECT_THAT(head, Not(HasSubstr("Upload-Complete")));
    std::string body(2000, ' ');
    ::recv(socket, body.data(), body.size(), MSG_WAITALL);
    EXPECT_TRUE(body == pattern(2000));
    test::answer(socket, "201 Created", to_json(some_volume()));
  });
  Client client({.server = server.url()});
  EXPECT_EQ(client.upload(file(pattern(2000)), {.resumable_bytes = 1000}), some_volume());
  EXPECT_THAT(asked, ElementsAre("POST", "PATCH", "HEAD", "POST"));
}

TEST_F(Upload, IsNotRepeatedWhenTheConnectionBreaks) {
  test::SocketServer server([](int socket) { test::read_head(socket); });
  Client client({.server = server.url()});
  EXPECT_EQ(error_of([&] { client.upload(file(pattern(1000))); }).code(), ErrorCode::kUnreachable);
  EXPECT_EQ(server.connections(), 1);
}

TEST_F(Upload, GivesBackWhatACallbackThrows) {
  FakeServer server;
  server.http.Post("/v1/volumes", [](const httplib::Request&, httplib::Response&) {});
  UploadOptions options;
  options.progress = [](std::uint64_t, std::uint64_t) { throw std::out_of_range("enough"); };
  Client client({.server = server.start()});
  EXPECT_THROW(client.upload(file(pattern(1000)), options), std::out_of_range);
}

TEST_F(Upload, NamesAFileThatIsNotThere) {
  Client client({.server = test::unused_url()});
  const Error error = error_of([&] { client.upload("/nowhere/head.nii"); });
  EXPECT_EQ(error.code(), ErrorCode::kInvalidParameter);
  EXPECT_THAT(error.what(), HasSubstr("/nowhere/head.nii"));
}

TEST_F(Upload, NamesAFileThatCannotBeLookedAt) {
  TemporaryFolder folder;
  std::filesystem::create_symlink("loop.nii", folder / "loop.nii");
  Client client({.server = test::unused_url()});
  const std::string too_long(300, 'a');
  for (const auto& path : {folder / "loop.nii", folder / too_long}) {
    const Error error = error_of([&] { client.upload(path); });
    EXPECT_EQ(error.code(), ErrorCode::kInvalidParameter);
    EXPECT_THAT(error.what(), HasSubstr(path.string() + ": "));
  }
  EXPECT_EQ(error_of([&] { client.upload(""); }).code(), ErrorCode::kInvalidParameter);
}

class Fetch : public testing::Test {
 protected:
  // A server whose job 7 announces `announced` and whose mesh is `sent`.
  Client client_for(const std::string& announced, const std::string& sent) {
    server_.http.Get("/v1/jobs/7", test::answering(to_json(finished_job("7", announced))));
    server_.http.Get("/v1/jobs/7/mesh.drc", test::answering(sent, "application/octet-stream"));
    return Client({.server = server_.start()});
  }

  FakeServer server_;
  TemporaryFolder folder_;
};

TEST_F(Fetch, WritesTheMeshAndNothingElse) {
  const std::string mesh = pattern(1'234'567);
  Client client = client_for(mesh, mesh);
  std::uint64_t last = 0;
  client.fetch("7", MeshFormat::kDrc, folder_ / "brain.drc",
               [&](std::uint64_t done, std::uint64_t total) {
                 EXPECT_EQ(total, mesh.size());
                 last = done;
               });
  EXPECT_EQ(last, mesh.size());
  EXPECT_TRUE(test::read_file(folder_ / "brain.drc") == mesh);
  EXPECT_THAT(test::files_below(folder_.path()), ElementsAre("brain.drc"));
}

TEST_F(Fetch, LeavesNoFileWhenOtherBytesCome) {
  std::string changed = pattern(1000);
  changed[500] ^= 1;
  Client client = client_for(pattern(1000), changed);
  const Error error = error_of([&] { client.fetch("7", MeshFormat::kDrc, folder_ / "brain.drc"); });
  EXPECT_EQ(error.code(), ErrorCode::kDigestMismatch);
  EXPECT_THAT(test::files_below(folder_.path()), IsEmpty());
}

TEST_F(Fetch, LeavesTheOldFileWhenTooManyBytesCome) {
  test::write_file(folder_ / "brain.drc", "old");
  Client client = client_for(pattern(1000), pattern(1'000'000));
  EXPECT_EQ(error_of([&] { client.fetch("7", MeshFormat::kDrc, folder_ / "brain.drc"); }).code(),
            ErrorCode::kDigestMismatch);
  EXPECT_EQ(test::read_file(folder_ / "brain.drc"), "old");
  EXPECT_THAT(test::files_below(folder_.path()), ElementsAre("brain.drc"));
}

TEST_F(Fetch, GivesTheReasonOfAJobThatFailed) {
  Job job = finished_job("7", "mesh");
  job.state = JobState::kFailed;
  job.mesh.reset();
  job.error = to_problem(Error(ErrorCode::kTooLarge, "the mesh has too many triangles"), "");
  server_.http.Get("/v1/jobs/7", test::answering(to_json(job)));
  Client client({.server = server_.start()});
  const Error error = error_of([&] { client.fetch("7", MeshFormat::kDrc, folder_ / "a.drc"); });
  EXPECT_EQ(error.code(), ErrorCode::kTooLarge);
  EXPECT_STREQ(error.what(), "the mesh has too many triangles");
}

// Announces the part of the mesh that the request's head asks for, and sends at most `most` bytes
// of it.
void send_mesh(int socket, const std::string& mesh, const std::string& head, std::size_t most) {
  const std::size_t at = head.find("Range: bytes=");
  const bool is_range = at != std::string::npos;
  const std::string rest = mesh.substr(is_range ? std::stoul(head.substr(at + 13)) : 0);
  test::send_text(socket, std::string("HTTP/1.1 ") + (is_range ? "206 Partial Content" : "200 OK") +
                              "\r\nContent-Length: " + std::to_string(rest.size()) + "\r\n\r\n" +
                              rest.substr(0, most));
}

// A server that knows no ranges sends the whole file again.
TEST_F(Fetch, GoesOnWhereTheConnectionBrokeOrStartsOver) {
  const std::string mesh = pattern(200'000);
  for (const bool knows_ranges : {true, false}) {
    std::vector<std::string> asked;
    const test::SocketServer server([&](int socket) {
      const std::string head = test::read_head(socket);
      if (head.find("mesh.drc") == std::string::npos) {
        return test::answer(socket, "200 OK", to_json(finished_job("7", mesh)));
      }
      asked.push_back(head);
      send_mesh(socket, mesh, knows_ranges ? head : "", asked.size() < 3 ? 70'000 : -1);
    });
    Client({.server = server.url()}).fetch("7", MeshFormat::kDrc, folder_ / "mesh.drc");
    EXPECT_TRUE(test::read_file(folder_ / "mesh.drc") == mesh);
    ASSERT_EQ(asked.size(), 3U);
    EXPECT_THAT(asked[0], Not(HasSubstr("Range")));
    EXPECT_THAT(asked[1], HasSubstr("\r\nRange: bytes=70000-\r\n"));
    EXPECT_THAT(asked[1], HasSubstr("\r\nIf-Range: \""));
    EXPECT_THAT(asked[2], HasSubstr(knows_ranges ? "bytes=140000-\r\n" : "bytes=70000-\r\n"));
  }
}

// A job by labels whose OBJ has these bytes.
Job labelled_job(const std::string& obj) {
  Job job = finished_job("7", obj, MeshFormat::kObj);
  job.parameters.labels.emplace();
  return job;
}

// The name of the materials is replaced in these bytes, which wait until they are complete.
TEST_F(Fetch, NamesTheMaterialsWhereTheConnectionBreaksInTheHeadOfAnObj) {
  const std::string line = "# isomesh, millimetres, SPACE=LPS\nmtllib mesh.mtl\n";
  for (const std::size_t size : {60U, 100U, 101U, 5000U}) {
    const std::string mesh = line + std::string(size - line.size(), '#');
    for (const bool knows_ranges : {true, false}) {
      int asked = 0;
      const test::SocketServer server([&](int socket) {
        const std::string head = test::read_head(socket);
        if (head.find("mesh.mtl") != std::string::npos) {
          return test::answer(socket, "200 OK", "newmtl a\n");
        }
        if (head.find("mesh.obj") == std::string::npos) {
          return test::answer(socket, "200 OK", to_json(labelled_job(mesh)));
        }
        send_mesh(socket, mesh, knows_ranges ? head : "", ++asked < 3 ? 20 : -1);
      });
      Client({.server = server.url()}).fetch("7", MeshFormat::kObj, folder_ / "left hip.obj");
      std::string expected = mesh;
      expected.replace(expected.find("mesh.mtl"), 8, "left_hip.mtl");
      EXPECT_EQ(test::read_file(folder_ / "left hip.obj"), expected);
      EXPECT_EQ(test::read_file(folder_ / "left_hip.mtl"), "newmtl a\n");
      EXPECT_EQ(asked, 3);
    }
  }
}

TEST_F(Fetch, PutsTheMaterialsBesideTheFileBehindALink) {
  const std::string mesh = "# isomesh, millimetres, SPACE=LPS\nmtllib mesh.mtl\n";
  server_.http.Get("/v1/jobs/7", test::answering(to_json(labelled_job(mesh))));
  server_.http.Get("/v1/jobs/7/mesh.obj", test::answering(mesh, "model/obj"));
  server_.http.Get("/v1/jobs/7/mesh.mtl", test::answering("newmtl a\n", "model/mtl"));
  Client client({.server = server_.start()});
  std::filesystem::create_directory(folder_ / "far");
  std::filesystem::create_symlink("far/real.obj", folder_ / "x.obj");
  client.fetch("7", MeshFormat::kObj, folder_ / "x.obj");
  EXPECT_THAT(test::read_file(folder_ / "far/real.obj"), HasSubstr("\nmtllib real.mtl\n"));
  EXPECT_EQ(test::read_file(folder_ / "far/real.mtl"), "newmtl a\n");
  // A file of another suffix keeps the server's bytes.
  client.fetch("7", MeshFormat::kObj, folder_ / "mesh");
  EXPECT_EQ(test::read_file(folder_ / "mesh"), mesh);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "mesh.mtl"));
}

TEST_F(Fetch, NamesEveryFileThatItWrites) {
  using Files = std::vector<std::filesystem::path>;
  EXPECT_EQ(files_of_mesh("a/x y.tar.obj", MeshFormat::kObj, true),
            (Files{"a/x y.tar.obj", "a/x_y.tar.mtl"}));
  EXPECT_EQ(files_of_mesh("X.OBJ", MeshFormat::kObj, true), (Files{"X.OBJ", "X.mtl"}));
  for (const bool is_by_labels : {true, false}) {
    EXPECT_EQ(files_of_mesh("x.stl", MeshFormat::kStl, is_by_labels), Files{"x.stl"});
    EXPECT_EQ(files_of_mesh("pipe", MeshFormat::kObj, is_by_labels), Files{"pipe"});
  }
  EXPECT_EQ(files_of_mesh("x.obj", MeshFormat::kObj, false), Files{"x.obj"});
}

TEST_F(Fetch, ReplacesNoFileIfItShallNot) {
  const std::string mesh = "# isomesh, millimetres, SPACE=LPS\nmtllib mesh.mtl\n";
  server_.http.Get("/v1/jobs/7", test::answering(to_json(labelled_job(mesh))));
  // Another program is quicker.
  std::string quicker;
  server_.http.Get("/v1/jobs/7/mesh.obj", [&](const auto&, httplib::Response& response) {
    if (!quicker.empty()) test::write_file(folder_ / quicker, "another's");
    response.set_content(mesh, "model/obj");
  });
  server_.http.Get("/v1/jobs/7/mesh.mtl", test::answering("newmtl a\n", "model/mtl"));
  Client client({.server = server_.start()});
  const auto fetch = [&](const std::string& name) {
    client.fetch("7", MeshFormat::kObj, folder_ / name, {}, {}, Existing::kRefuse);
  };
  fetch("new.obj");
  EXPECT_EQ(test::read_file(folder_ / "new.mtl"), "newmtl a\n");
  std::filesystem::create_symlink("far", folder_ / "link.mtl");
  test::write_file(folder_ / "old.mtl", "another's");
  for (const std::string name : {"new", "old", "link"}) {
    EXPECT_THAT(error_of([&] { fetch(name + ".obj"); }).what(), HasSubstr("File exists")) << name;
  }
  for (const std::string late : {"late.obj", "late.mtl"}) {
    quicker = late;
    EXPECT_THAT(error_of([&] { fetch("late.obj"); }).what(), HasSubstr(late + ": File exists"));
    EXPECT_EQ(test::read_file(folder_ / late), "another's");
    std::filesystem::remove(folder_ / "late.obj");
    std::filesystem::remove(folder_ / "late.mtl");
  }
  EXPECT_FALSE(std::filesystem::exists(folder_ / "far"));
  EXPECT_EQ(test::read_file(folder_ / "old.mtl"), "another's");
}

TEST_F(Fetch, NamesATargetThatCannotBeWritten) {
  Client client = client_for("mesh", "mesh");
  const auto target = folder_ / "missing" / "brain.drc";
  const Error error = error_of([&] { client.fetch("7", MeshFormat::kDrc, target); });
  EXPECT_EQ(error.code(), ErrorCode::kInvalidParameter);
  EXPECT_THAT(error.what(), HasSubstr("brain.drc"));
}

}  // namespace
}  // namespace isomesh
