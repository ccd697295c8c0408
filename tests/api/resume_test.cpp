// Uploads that come in parts, over cut connections and a killed daemon.
#include <algorithm>
#include <filesystem>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/json.h"
#include "tests/api/daemon.h"
#include "tests/api/digest.h"
#include "tests/api/problems.h"

namespace isomesh {
namespace {

using namespace test;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::MatchesRegex;

const Headers kBegin = {{"Upload-Complete", "?0"}};

Headers part(std::size_t offset, bool is_last) {
  return {{"Content-Type", "application/partial-upload"},
          {"Upload-Offset", std::to_string(offset)},
          {"Upload-Complete", is_last ? "?1" : "?0"}};
}

std::vector<std::string> files_of_uploads(const std::filesystem::path& data) {
  std::vector<std::string> files = files_below(data);
  std::erase_if(files, [](const std::string& file) { return !file.starts_with("uploads/"); });
  return files;
}

class ResumeTest : public testing::Test {
 protected:
  Answer begin(const Headers& headers = kBegin, const std::string& body = {}) {
    return daemon_->send("POST", "/v1/volumes?" + raw_.query, body, headers);
  }
  std::string begun() { return begin().header("location"); }
  std::string offset_of(const std::string& place) {
    return daemon_->send("HEAD", place).header("upload-offset");
  }

  // Sends the head of a part and some of its body, and ends the connection.
  void send_cut(const std::string& place, std::size_t from, std::size_t to) {
    const std::string whole = request("PATCH", place, raw_.bytes.substr(from), part(from, true));
    const std::size_t body = raw_.bytes.size() - from;
    const Connection connection(daemon_->url());
    connection.send(whole.substr(0, whole.size() - body + (to - from)));
    connection.finish_sending();
    EXPECT_EQ(connection.receive().status, 400);
  }

  const TemporaryFolder folder_;
  std::optional<Daemon> daemon_{std::in_place, folder_ / "data", "127.0.0.1:0"};
  RawUpload raw_ = sphere_upload();
};

TEST_F(ResumeTest, PartsBecomeTheVolumeThatTheyAreTogether) {
  const Answer first = begin({{"Upload-Complete", "?0"},
                              {"Upload-Length", std::to_string(raw_.bytes.size())},
                              {"Content-Disposition", "attachment; filename=\"ball.raw\""}});
  EXPECT_EQ(first.status, 201);
  EXPECT_EQ(first.body, "");
  EXPECT_EQ(first.header("upload-offset"), "0");
  EXPECT_EQ(first.header("upload-complete"), "?0");
  EXPECT_EQ(first.header("upload-limit"), "max-size=8589934592, max-age=3600");
  const std::string place = first.header("location");
  ASSERT_THAT(place, MatchesRegex("/v1/uploads/[0-9a-f]{32}"));

  const Answer middle = daemon_->send("PATCH", place, raw_.bytes.substr(0, 1000), part(0, false));
  EXPECT_EQ(middle.status, 204) << middle.body;
  EXPECT_EQ(middle.header("upload-offset"), "1000");
  const Answer state = daemon_->send("HEAD", place);
  EXPECT_EQ(state.status, 204);
  EXPECT_EQ(state.header("upload-offset"), "1000");
  EXPECT_EQ(state.header("upload-length"), std::to_string(raw_.bytes.size()));
  EXPECT_EQ(state.header("cache-control"), "no-store");

  const Answer last = daemon_->send("PATCH", place, raw_.bytes.substr(1000), part(1000, true));
  ASSERT_EQ(last.status, 201) << last.body;
  EXPECT_EQ(last.header("upload-complete"), "?1");
  const Volume volume = volume_from_json(last.body);
  EXPECT_EQ(last.header("location"), "/v1/volumes/" + volume.id);
  EXPECT_EQ(volume.name, "ball.raw");
  EXPECT_EQ(upload(*daemon_, raw_).id, volume.id);
}

TEST_F(ResumeTest, WhatItBecameIsToldUntilThatIsDeleted) {
  const std::string place = begun();
  ASSERT_EQ(daemon_->send("PATCH", place, raw_.bytes, part(0, true)).status, 201);
  const std::string ask = "/v1/volumes?upload=" + place.substr(place.rfind('/') + 1);
  const Answer again = daemon_->send("POST", ask);
  ASSERT_EQ(again.status, 200) << again.body;
  const std::string id = volume_from_json(again.body).id;
  EXPECT_EQ(daemon_->send("DELETE", "/v1/volumes/" + id).status, 204);
  EXPECT_TRUE(is_problem(daemon_->send("POST", ask), ErrorCode::kGone));
}

TEST_F(ResumeTest, TheFirstPartMayComeWithTheBeginning) {
  const Answer first = begin(kBegin, raw_.bytes.substr(0, 500));
  EXPECT_EQ(first.header("upload-offset"), "500");
  const std::string rest = raw_.bytes.substr(500);
  EXPECT_EQ(daemon_->send("PATCH", first.header("location"), rest, part(500, true)).status, 201);
}

TEST_F(ResumeTest, AnUploadAtOnceMayTellItsLengthWhichMustBeRight) {
  const std::string size = std::to_string(raw_.bytes.size());
  EXPECT_TRUE(blames(begin({{"Upload-Complete", "?2"}}, raw_.bytes), "Upload-Complete"));
  EXPECT_TRUE(blames(begin({{"Upload-Complete", "?1"}, {"Upload-Length", size + "0"}}, raw_.bytes),
                     "Upload-Length"));
  EXPECT_TRUE(daemon_->client().volumes().empty());
  EXPECT_EQ(begin({{"Upload-Complete", "?1"}, {"Upload-Length", size}}, raw_.bytes).status, 201);
}

TEST_F(ResumeTest, WhatCameBeforeAConnectionBrokeStays) {
  raw_ = long_upload();  // a small body is handed over when all of it is there
  const std::string place = begun();
  send_cut(place, 0, 300'000);
  ASSERT_EQ(offset_of(place), "300000");
  send_cut(place, 300'000, 300'001);
  ASSERT_EQ(offset_of(place), "300001");
  const Answer last =
      daemon_->send("PATCH", place, raw_.bytes.substr(300'001), part(300'001, true));
  EXPECT_EQ(last.status, 201) << last.body;
  EXPECT_THAT(files_of_uploads(daemon_->data()), ElementsAre(testing::EndsWith(".json")));
}

TEST_F(ResumeTest, WhoAsksHowFarItIsEndsTheOneThatSends) {
  const std::string place = begun();
  const std::string whole = request("PATCH", place, std::string(900'000, 'a'), part(0, true));
  const Connection old(daemon_->url());
  old.send(whole.substr(0, 600'000));
  const std::filesystem::path file = daemon_->data() / place.substr(std::string("/v1/").size());
  ASSERT_TRUE(eventually([&] { return std::filesystem::file_size(file) > 0; }));
  const std::string told = offset_of(place);
  EXPECT_NE(told, "0");
  old.send(whole.substr(600'000));
  EXPECT_EQ(old.receive().status, 503);
  EXPECT_EQ(offset_of(place), told);
}

TEST_F(ResumeTest, AnotherOffsetIsRefusedAndToldTheRightOne) {
  const std::string place = begun();
  daemon_->send("PATCH", place, raw_.bytes.substr(0, 1000), part(0, false));
  for (const std::size_t wrong : {0U, 999U, 1001U}) {
    const Answer answer = daemon_->send("PATCH", place, "bytes", part(wrong, false));
    EXPECT_EQ(answer.status, 409);
    EXPECT_EQ(answer.header("upload-offset"), "1000");
    EXPECT_THAT(answer.body, HasSubstr("http-problem-types#mismatching-upload-offset"));
  }
}

TEST_F(ResumeTest, WhatIsNoPartIsRefusedByName) {
  const std::string place = begun();
  const auto patch = [&](const Headers& headers) {
    return daemon_->send("PATCH", place, "bytes", headers);
  };
  const std::pair<std::string, std::string> type = {"Content-Type", "application/partial-upload"};
  EXPECT_TRUE(is_problem(patch({{"Upload-Offset", "0"}, {"Upload-Complete", "?0"}}),
                         ErrorCode::kUnsupportedMedia));
  EXPECT_TRUE(blames(patch({type, {"Upload-Complete", "?0"}}), "Upload-Offset"));
  EXPECT_TRUE(blames(patch({type, {"Upload-Offset", "0"}}), "Upload-Complete"));
  EXPECT_TRUE(
      blames(patch({type, {"Upload-Offset", "0"}, {"Upload-Complete", "yes"}}), "Upload-Complete"));
  EXPECT_TRUE(is_problem(patch(with(part(0, true), {{"Upload-Length", "6"}})),
                         ErrorCode::kInvalidParameter));
  EXPECT_EQ(offset_of(place), "0");
  EXPECT_TRUE(
      is_problem(begin(with(kBegin, {{"Upload-Length", "8589934593"}})), ErrorCode::kTooLarge));
  for (const std::string length : {"-1", "abc", "99999999999999999999999"}) {
    EXPECT_TRUE(blames(begin(with(kBegin, {{"Upload-Length", length}})), "Upload-Length"))
        << length;
  }
  EXPECT_TRUE(blames(daemon_->send("POST", "/v1/volumes?dims=1", {}, kBegin), "dims"));
}

TEST_F(ResumeTest, TheLengthHolds) {
  const std::string place = begin(with(kBegin, {{"Upload-Length", "10"}})).header("location");
  EXPECT_TRUE(
      blames(daemon_->send("PATCH", place, "0123456789a", part(0, false)), "Upload-Length"));
  EXPECT_TRUE(blames(daemon_->send("PATCH", place, "012345678", part(0, true)), "Upload-Length"));
  EXPECT_TRUE(blames(daemon_->send("PATCH", place, "", part(0, true)), "Upload-Length"));
}

TEST_F(ResumeTest, DigestsAreChecked) {
  const std::string wrong =
      begin(with(kBegin, {{"Repr-Digest", digest_of("other")}})).header("location");
  EXPECT_TRUE(is_problem(daemon_->send("PATCH", wrong, raw_.bytes, part(0, true)),
                         ErrorCode::kDigestMismatch));
  // Nothing of it stays to be asked for.
  EXPECT_TRUE(
      is_problem(daemon_->send("POST", "/v1/volumes?upload=" + wrong.substr(wrong.rfind('/') + 1)),
                 ErrorCode::kGone));
  const std::string right =
      begin(with(kBegin, {{"Repr-Digest", digest_of(raw_.bytes)}})).header("location");
  const std::string half = raw_.bytes.substr(0, 2000);
  EXPECT_TRUE(
      is_problem(daemon_->send("PATCH", right, half,
                               with(part(0, false), {{"Content-Digest", digest_of("other")}})),
                 ErrorCode::kDigestMismatch));
  EXPECT_EQ(offset_of(right), "0");
  daemon_->send("PATCH", right, half, with(part(0, false), {{"Content-Digest", digest_of(half)}}));
  EXPECT_EQ(daemon_->send("PATCH", right, raw_.bytes.substr(2000), part(2000, true)).status, 201);
}

TEST_F(ResumeTest, DigestsOfAWholeBodyAreChecked) {
  for (const std::string header : {"Content-Digest", "Repr-Digest"}) {
    const auto send = [&](const std::string& of) {
      return daemon_->send("POST", "/v1/volumes?" + raw_.query, raw_.bytes,
                           {{"Upload-Complete", "?1"}, {header, digest_of(of)}});
    };
    EXPECT_TRUE(is_problem(send("other"), ErrorCode::kDigestMismatch)) << header;
    EXPECT_LT(send(raw_.bytes).status, 300) << header;
  }
  const std::string digest = digest_of(raw_.bytes);
  EXPECT_LT(daemon_
                ->send("POST", "/v1/volumes?" + raw_.query, raw_.bytes,
                       {{"Content-Digest", digest}, {"Repr-Digest", digest}})
                .status,
            300);
}

TEST_F(ResumeTest, WhoDidNotHearTheAnswerAsksAgain) {
  const std::string place = begun();
  const std::string again =
      "/v1/volumes?" + raw_.query + "&upload=" + place.substr(place.rfind('/') + 1);
  EXPECT_TRUE(is_problem(daemon_->send("POST", again), ErrorCode::kNotReady));
  const Answer last = daemon_->send("PATCH", place, raw_.bytes, part(0, true));
  ASSERT_EQ(last.status, 201) << last.body;
  EXPECT_EQ(daemon_->send("HEAD", place).header("upload-complete"), "?1");
  for (const bool is_killed : {false, true}) {
    if (is_killed) daemon_.emplace(folder_ / "data", "127.0.0.1:0");
    const Answer heard = daemon_->send("POST", again);
    EXPECT_EQ(heard.status, 200);
    EXPECT_EQ(volume_from_json(heard.body), volume_from_json(last.body));
    EXPECT_TRUE(blames(daemon_->send("POST", again, "a body"), "upload"));
    EXPECT_EQ(daemon_->send("PATCH", place, "more", part(raw_.bytes.size(), true)).status, 400);
  }
}

TEST_F(ResumeTest, WhatLeavesSomethingToBeChosenIsReadAgain) {
  const std::string place =
      daemon_->send("POST", "/v1/volumes?keep=true", {}, kBegin).header("location");
  const Answer open = daemon_->send("PATCH", place, std::string(24, 'a'), part(0, true));
  EXPECT_EQ(open.status, 415);
  EXPECT_EQ(open.header("upload-complete"), "?1");
  const std::string name = open.header("isomesh-upload");
  EXPECT_EQ("/v1/uploads/" + name, place);
  const std::string described = "/v1/volumes?dims=4,3,2&type=uint8&upload=" + name;
  EXPECT_EQ(daemon_->send("POST", described).status, 201);
}

TEST_F(ResumeTest, OneThatIsGivenUpLeavesNothing) {
  const std::string place = begun();
  daemon_->send("PATCH", place, raw_.bytes.substr(0, 1000), part(0, false));
  EXPECT_EQ(files_of_uploads(daemon_->data()).size(), 2U);
  EXPECT_EQ(daemon_->send("DELETE", place).status, 204);
  EXPECT_EQ(daemon_->send("HEAD", place).status, 409);
  EXPECT_TRUE(is_problem(daemon_->get(place), ErrorCode::kCancelled));
  EXPECT_TRUE(
      is_problem(daemon_->send("PATCH", place, "a", part(1000, false)), ErrorCode::kCancelled));
  EXPECT_EQ(daemon_->send("DELETE", place).status, 410);
  EXPECT_THAT(files_of_uploads(daemon_->data()), IsEmpty());
}

TEST_F(ResumeTest, ARequestThatIsTooLargeTakesNothingFromOthers) {
  const std::string place = begun();
  ASSERT_EQ(daemon_->send("PATCH", place, raw_.bytes.substr(0, 1000), part(0, false)).status, 204);
  const Answer refused = answer_to(daemon_->url(),
                                   "POST /v1/volumes HTTP/1.1\r\nHost: localhost\r\n"
                                   "Content-Length: 99999999999999\r\n\r\n");
  EXPECT_TRUE(is_problem(refused, ErrorCode::kTooLarge));
  EXPECT_EQ(offset_of(place), "1000");
}

// Somebody else with the same token cancels it.
TEST_F(ResumeTest, AClientDoesNotSendAgainWhatWasCancelled) {
  raw_ = long_upload();
  write_file(folder_ / "body", raw_.bytes);
  Client client = daemon_->client();
  bool is_cancelled = false;
  UploadOptions options{.resumable_bytes = 1};
  options.progress = [&](std::uint64_t done, std::uint64_t total) {
    const std::vector<std::string> files = files_of_uploads(daemon_->data());
    if (is_cancelled || done < total / 2 || files.empty()) return;
    is_cancelled = true;
    const std::string file = files.front();
    const std::string place = "/v1/" + file.substr(0, file.find('.'));
    EXPECT_EQ(daemon_->send("DELETE", place).status, 204);
  };
  try {
    client.upload(folder_ / "body", options);
    ADD_FAILURE() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCancelled);
    EXPECT_STREQ(error.what(), "the upload was cancelled");
  }
  EXPECT_TRUE(daemon_->client().volumes().empty());
}

TEST_F(ResumeTest, CancellingAVolumeThatIsStoredTellsItsId) {
  const std::string place = begun();
  const Answer last = daemon_->send("PATCH", place, raw_.bytes, part(0, true));
  ASSERT_EQ(last.status, 201) << last.body;
  const Answer told = daemon_->send("DELETE", place);
  EXPECT_EQ(told.status, 200);
  ASSERT_EQ(volumes_from_json(told.body).size(), 1U);
  EXPECT_EQ(volumes_from_json(told.body).front().id, volume_from_json(last.body).id);
  EXPECT_EQ(daemon_->send("HEAD", place).status, 409);
  EXPECT_EQ(daemon_->client().volumes().size(), 1U);
  EXPECT_THAT(files_of_uploads(daemon_->data()), IsEmpty());
}

TEST_F(ResumeTest, CancellingKnowsTheVolumeOfAnEarlierProcess) {
  const std::string place = begun();
  ASSERT_EQ(daemon_->send("PATCH", place, raw_.bytes, part(0, true)).status, 201);
  daemon_->stop();
  daemon_.emplace(folder_ / "data", "127.0.0.1:0");
  const Answer told = daemon_->send("DELETE", place);
  EXPECT_EQ(told.status, 200);
  EXPECT_EQ(volumes_from_json(told.body).size(), 1U);
}

TEST_F(ResumeTest, CancellingAfterTheVolumeWasDeletedTellsNone) {
  const std::string place = begun();
  const Answer last = daemon_->send("PATCH", place, raw_.bytes, part(0, true));
  ASSERT_EQ(daemon_->send("DELETE", last.header("location")).status, 204);
  EXPECT_EQ(daemon_->send("DELETE", place).status, 204);
}

// Imports with faulty_import.cpp, which never ends for the upload "hang".
class SlowImportTest : public ResumeTest {
 protected:
  SlowImportTest() {
    namespace fs = std::filesystem;
    raw_ = {.bytes = "hang", .query = "dims=2,2,1&type=uint8", .options = {}};
    // A daemon runs the programs beside its own file.
    const fs::path programs = folder_ / "programs";
    fs::create_directory(programs);
    fs::copy_file(ISOMESHD, programs / "isomeshd");
    fs::create_symlink(ISOMESH_JOB, programs / "isomesh-job");
    fs::create_symlink(FAULTY_IMPORT, programs / "isomesh-import");
    const std::string replace = "shift; exec " + (programs / "isomeshd").string() + " \"$@\"";
    daemon_.emplace(folder_ / "slow", "127.0.0.1:0", std::vector<std::string>{},
                    std::vector<std::string>{"bash", "-c", replace, "bash"});
  }

  // True once the only upload is complete, so that its import runs or is about to.
  bool is_read() const {
    const std::vector<std::string> files = files_of_uploads(daemon_->data());
    return std::ranges::any_of(files, [&](const std::string& file) {
      return file.ends_with(".json") &&
             read_file(daemon_->data() / file).find("\"complete\":true") != std::string::npos;
    });
  }
};

TEST_F(SlowImportTest, CancellingEndsTheImport) {
  const std::string place = begun();
  Answer last;
  std::jthread sender([&] { last = daemon_->send("PATCH", place, raw_.bytes, part(0, true)); });
  ASSERT_TRUE(eventually([&] { return is_read(); }));
  EXPECT_EQ(daemon_->send("DELETE", place).status, 204);
  sender.join();
  EXPECT_TRUE(is_problem(last, ErrorCode::kCancelled));
  EXPECT_EQ(daemon_->send("DELETE", place).status, 410);
  EXPECT_TRUE(daemon_->client().volumes().empty());
  EXPECT_THAT(files_of_uploads(daemon_->data()), IsEmpty());
}

// Also one that was asked for again, because its response was lost.
TEST_F(SlowImportTest, CancellingEndsAllImportsOfTheUpload) {
  const std::string place = begun();
  Answer last;
  Answer again;
  std::jthread sender([&] { last = daemon_->send("PATCH", place, raw_.bytes, part(0, true)); });
  ASSERT_TRUE(eventually([&] { return is_read(); }));
  std::jthread asker([&] {
    again = daemon_->send(
        "POST", "/v1/volumes?" + raw_.query + "&upload=" + place.substr(place.rfind('/') + 1));
  });
  EXPECT_EQ(daemon_->send("DELETE", place).status, 204);
  sender.join();
  asker.join();
  EXPECT_TRUE(is_problem(last, ErrorCode::kCancelled));
  EXPECT_TRUE(again.status == 409 || again.status == 410) << again.body;
}

TEST_F(SlowImportTest, AClientThatIsStoppedCancelsTheImport) {
  write_file(folder_ / "body", raw_.bytes);
  std::stop_source stop;
  Client client({.server = daemon_->url(), .stop = stop.get_token()});
  UploadOptions options;
  options.raw.emplace().dims = {2, 2, 1};
  options.resumable_bytes = 1;
  std::optional<ErrorCode> code;
  std::jthread sender([&] {
    try {
      client.upload(folder_ / "body", options);
    } catch (const Error& error) {
      code = error.code();
    }
  });
  ASSERT_TRUE(eventually([&] { return is_read(); }));
  stop.request_stop();
  sender.join();
  EXPECT_EQ(code, ErrorCode::kCancelled);
  EXPECT_TRUE(daemon_->client().volumes().empty());
  // They go with the import's request, which may end after that of the client.
  EXPECT_TRUE(eventually([&] { return files_of_uploads(daemon_->data()).empty(); }));
}

TEST_F(ResumeTest, AKilledDaemonGoesOnWhereItWas) {
  const std::string place = begun();
  daemon_->send("PATCH", place, raw_.bytes.substr(0, 5000), part(0, false));
  daemon_->send_signal(SIGKILL);
  daemon_->wait();
  write_file(folder_ / "data/uploads/0123.json", "no note");
  write_file(folder_ / "data/uploads/4567", "no upload");
  daemon_.emplace(folder_ / "data", "127.0.0.1:0");
  EXPECT_EQ(files_of_uploads(daemon_->data()).size(), 2U);
  ASSERT_EQ(offset_of(place), "5000");
  const Answer last = daemon_->send("PATCH", place, raw_.bytes.substr(5000), part(5000, true));
  ASSERT_EQ(last.status, 201) << last.body;
  EXPECT_EQ(upload(*daemon_, raw_).id, volume_from_json(last.body).id);
}

TEST_F(ResumeTest, WhatAnotherStartOfTheMachineLeftIsNotBelieved) {
  const std::string place = begun();
  daemon_->stop();
  const std::string note =
      folder_ / "data" / ("uploads/" + place.substr(place.rfind('/') + 1) + ".json");
  const std::string text = read_file(note);
  const std::size_t boot = text.find("\"boot\":\"") + 8;
  write_file(note, text.substr(0, boot) + (text[boot] == '0' ? '1' : '0') + text.substr(boot + 1));
  daemon_.emplace(folder_ / "data", "127.0.0.1:0");
  EXPECT_EQ(daemon_->send("HEAD", place).status, 410);
  EXPECT_THAT(files_of_uploads(daemon_->data()), IsEmpty());
}

TEST_F(ResumeTest, BelongsToItsOwnerAlone) {
  const std::string file = folder_ / "tokens";
  const auto bearer = [&](const std::string& name) {
    const Finished added = run({ISOMESHD, "token", "add", name, "--role", "user", "--into", file});
    return Headers{{"Authorization", "Bearer " + added.line()}};
  };
  const Headers ct = bearer("ct");
  const Headers mr = bearer("mr");
  const Daemon guarded{std::vector<std::string>{"--tokens", file}};
  const std::string place =
      guarded.send("POST", "/v1/volumes?" + raw_.query, {}, with(kBegin, ct)).header("location");
  EXPECT_EQ(guarded.send("HEAD", place, {}, mr).status, 410);
  EXPECT_EQ(guarded.send("PATCH", place, "bytes", with(part(0, false), mr)).status, 410);
  EXPECT_EQ(guarded.send("DELETE", place, {}, mr).status, 410);
  EXPECT_EQ(guarded.send("HEAD", place).status, 401);
  EXPECT_EQ(guarded.send("HEAD", place, {}, ct).header("upload-offset"), "0");
}

// The real client under a daemon that is killed in the middle, on a socket that is the same after.
TEST_F(ResumeTest, TheClientGoesOnByItselfOverAKilledDaemon) {
  const RawUpload large = raw_upload(noise<std::uint8_t>({0, 100}, {320, 256, 200}, 3));
  write_file(folder_ / "large.raw", large.bytes);
  const std::string listen = "unix:" + (folder_ / "socket").string();
  daemon_.emplace(folder_ / "data", listen);
  Client client({.server = listen});
  int kills = 0;
  std::uint64_t least = large.bytes.size();  // that was sent after the kill
  UploadOptions options;
  options.raw.emplace().dims = {320, 256, 200};
  options.progress = [&](std::uint64_t done, std::uint64_t total) {
    if (kills > 0) least = std::min(least, done);
    if (kills > 0 || done < total / 2) return;
    ++kills;
    daemon_->send_signal(SIGKILL);
    daemon_->wait();
    daemon_.emplace(folder_ / "data", listen);
  };
  const Volume volume = client.upload(folder_ / "large.raw", options);
  EXPECT_EQ(kills, 1);
  EXPECT_GT(least, large.bytes.size() / 4);
  EXPECT_EQ(volume.bytes, large.bytes.size());
  EXPECT_EQ(upload(*daemon_, large).id, volume.id);
}

}  // namespace
}  // namespace isomesh
