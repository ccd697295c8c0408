// `isomeshd backup` beside a daemon at work, and `isomeshd restore`.
#include <atomic>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/json.h"
#include "tests/api/daemon.h"

namespace isomesh {
namespace {

using namespace test;
using testing::HasSubstr;

JobParameters drc_of(const std::string& volume) {
  JobParameters parameters;
  parameters.volume = volume;
  parameters.iso = 100;
  return parameters;
}

// A volume whose last sample is that one.
Volume upload(const Daemon& daemon, std::uint8_t sample) {
  std::string bytes(8 * 8 * 8, '\0');
  bytes[300] = static_cast<char>(200);
  bytes.back() = static_cast<char>(sample);
  return volume_from_json(daemon.send("POST", "/v1/volumes?dims=8,8,8&type=uint8", bytes).body);
}

Finished isomeshd(const std::string& verb, const std::string& folder, const std::string& data) {
  return run({ISOMESHD, verb, folder, "--data", data});
}

TEST(Backup, IsWholeAlthoughTheDaemonWorks) {
  const TemporaryFolder folder;
  const Daemon daemon(folder / "data", "127.0.0.1:0");
  const std::string kept = upload(daemon, 1).id;
  Client client = daemon.client();
  const Job job = client.wait(client.submit(drc_of(kept)).id);
  client.fetch(job.id, MeshFormat::kDrc, folder / "before.drc");

  // Volumes and meshes come and go meanwhile.
  std::atomic<bool> is_over = false;
  std::jthread busy([&] {
    Client other = daemon.client();
    for (std::uint8_t sample = 2; !is_over; sample = sample < 250 ? sample + 1 : 2) {
      const std::string volume = upload(daemon, sample).id;
      other.wait(other.submit(drc_of(volume)).id);
      if (sample % 2 == 0) other.erase_volume(volume);
    }
  });
  for (int round = 0; round < 5; ++round) {
    const std::string backup = folder / ("backup" + std::to_string(round));
    const Finished made = isomeshd("backup", backup, folder / "data");
    ASSERT_EQ(made.status, 0) << made.errors;
    EXPECT_EQ(made.errors, "");
  }
  is_over = true;
  busy.join();

  for (int round = 0; round < 5; ++round) {
    const std::string restored = folder / ("restored" + std::to_string(round));
    const Finished put_back =
        isomeshd("restore", folder / ("backup" + std::to_string(round)), restored);
    ASSERT_EQ(put_back.status, 0) << put_back.errors;
    EXPECT_EQ(put_back.errors, "");
    Daemon second(restored, "127.0.0.1:0", {"--log-level", "error"});
    Client reader = second.client();
    reader.fetch(job.id, MeshFormat::kDrc, folder / "after.drc");
    EXPECT_EQ(read_file(folder / "after.drc"), read_file(folder / "before.drc"));
    EXPECT_EQ(reader.histogram(kept, 2).counts.size(), 2U);
    // Every finished job has its mesh, and every volume its samples.
    for (const Job& each : reader.jobs({.state = JobState::kSucceeded}).jobs) {
      EXPECT_NO_THROW(reader.fetch(each.id, MeshFormat::kDrc, folder / "each.drc"));
    }
    for (const Volume& each : reader.volumes()) EXPECT_NO_THROW(reader.histogram(each.id, 2));
    EXPECT_EQ(second.stop(), 0);
    EXPECT_THAT(second.errors(),
                testing::Not(testing::AnyOf(HasSubstr(" warning "), HasSubstr(" error "))));
  }
}

TEST(Backup, SaysWhatIsDamagedOrMissing) {
  const TemporaryFolder folder;
  Volume damaged;
  Volume missing;
  {
    Daemon daemon(folder / "data", "127.0.0.1:0");
    damaged = upload(daemon, 1);
    missing = upload(daemon, 2);
    upload(daemon, 3);
    EXPECT_EQ(daemon.stop(), 0);
  }
  const std::filesystem::path blobs = folder / "data/blobs";
  write_file(blobs / damaged.samples.substr(0, 2) / damaged.samples, "spoilt");
  std::filesystem::remove(blobs / missing.samples.substr(0, 2) / missing.samples);
  const Finished made = isomeshd("backup", folder / "backup", folder / "data");
  EXPECT_EQ(made.status, 1);
  EXPECT_THAT(made.output, HasSubstr("copied 2 files"));
  EXPECT_THAT(made.errors, HasSubstr("the volume " + damaged.id + " is damaged"));
  EXPECT_THAT(made.errors, HasSubstr("the volume " + missing.id + " is missing"));
  const Finished restored = isomeshd("restore", folder / "backup", folder / "restored");
  EXPECT_EQ(restored.status, 1);
  EXPECT_THAT(restored.errors, HasSubstr("the volume " + missing.id + " is missing"));
}

TEST(Backup, ARestoreThatFailsLeavesNothing) {
  const TemporaryFolder folder;
  {
    Daemon daemon(folder / "data", "127.0.0.1:0");
    upload(daemon, 1);
    EXPECT_EQ(daemon.stop(), 0);
  }
  ASSERT_EQ(isomeshd("backup", (folder / "backup").string() + '/', folder / "data").status, 0);
  const std::filesystem::path records = folder / "backup/isomesh.sqlite";
  const std::string whole = read_file(records);
  write_file(records, whole.substr(0, whole.size() / 2));
  std::filesystem::create_directory(folder / "empty");
  for (const std::filesystem::path& target : {folder / "new", folder / "empty"}) {
    EXPECT_EQ(isomeshd("restore", folder / "backup", target).status, 1);
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "new"));
  EXPECT_TRUE(std::filesystem::is_empty(folder / "empty"));
  write_file(records, whole);
  EXPECT_EQ(isomeshd("restore", folder / "backup", folder / "empty").status, 0);
  // As one that was killed leaves it.
  write_file(folder / "empty/restoring", "");
  const Finished refused = refused_start(folder / "empty");
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.errors, HasSubstr("restore again"));
  const Finished again = isomeshd("restore", folder / "backup", folder / "empty");
  EXPECT_EQ(again.status, 1);
  EXPECT_THAT(again.errors, HasSubstr("was not restored completely"));
}

TEST(Backup, RefusesWhatWouldLoseSomething) {
  const TemporaryFolder folder;
  {
    Daemon daemon(folder / "data", "127.0.0.1:0");
    upload(daemon, 1);
    EXPECT_EQ(daemon.stop(), 0);
  }
  ASSERT_EQ(isomeshd("backup", folder / "backup", folder / "data").status, 0);
  const std::vector<std::vector<std::string>> wrong = {
      {"backup", folder / "backup", folder / "data", "already exists"},
      {"backup", folder / "other", folder / "nothing", "is not a data folder"},
      {"backup", folder / "no/such/folder", folder / "data", "no/such/folder.part"},
      {"restore", folder / "backup", folder / "data", "is not empty"},
      {"restore", folder / "nothing", folder / "new", "is not a data folder"},
      {"backup", folder / "data/inside", folder / "data", "is inside the data folder"},
      {"restore", folder / "backup", folder / "backup/inside", "is inside the backup"},
  };
  for (const auto& each : wrong) {
    const Finished refused = isomeshd(each[0], each[1], each[2]);
    EXPECT_EQ(refused.status, 1) << each[3];
    EXPECT_THAT(refused.errors, HasSubstr(each[3]));
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "other.part"));
  EXPECT_FALSE(std::filesystem::exists(folder / "new"));
}

}  // namespace
}  // namespace isomesh
