// Tests of files that the disk has corrupted.
#include <algorithm>
#include <string>

#include "proto/json_tree.h"
#include "tests/api/problems.h"
#include "tests/faults/fixture.h"

namespace isomesh {
namespace {

using namespace test;
using testing::HasSubstr;

class Damage : public FaultTest {
 protected:
  static const MeshFile& mesh(const Job& job) { return job.mesh->files.at(MeshFormat::kDrc); }
};

TEST_F(Damage, AMeshThatIsSpoiltOrMissingIsNotServedAndMadeAgain) {
  start();
  const Job job = finished_job(daemon());
  const std::string bytes = mesh_of(job);
  spoil(mesh(job).sha256);
  const Answer refused = daemon().get(mesh(job).href);
  EXPECT_TRUE(is_problem(refused, ErrorCode::kUnavailable));
  EXPECT_THAT(refused.body, HasSubstr("made again"));
  EXPECT_FALSE(refused.header("retry-after").empty());
  ASSERT_TRUE(eventually([&] { return daemon().get(mesh(job).href).status == 200; }));
  EXPECT_EQ(mesh_of(job), bytes);
  // Whoever asks just as it is there again gets a job that takes it over.
  const auto jobs = daemon().client().jobs().jobs;
  EXPECT_EQ(std::ranges::count(jobs, false, &Job::reused), 2) << "it was made again once";
  EXPECT_EQ(this->job(job.id), job);
  std::filesystem::remove(file_of(mesh(job).sha256));
  EXPECT_TRUE(is_problem(daemon().get(mesh(job).href), ErrorCode::kUnavailable));
  ASSERT_TRUE(eventually([&] { return daemon().get(mesh(job).href).status == 200; }));
  EXPECT_EQ(mesh_of(job), bytes);
}

TEST_F(Damage, AMeshIsNotHandedOutAgain) {
  start();
  const Job job = finished_job(daemon());
  const std::string bytes = mesh_of(job);
  EXPECT_TRUE(finished_job(daemon()).reused);
  spoil(mesh(job).sha256);
  const Job again = finished_job(daemon());
  EXPECT_FALSE(again.reused);
  EXPECT_EQ(mesh_of(again), bytes);
  EXPECT_EQ(mesh_of(job), bytes);
}

TEST_F(Damage, AMeshWithoutItsVolumeIsGone) {
  start();
  const Job job = finished_job(daemon());
  spoil(mesh(job).sha256);
  EXPECT_EQ(daemon().send("DELETE", "/v1/volumes/" + job.parameters.volume).status, 204);
  const Answer gone = daemon().get(mesh(job).href);
  EXPECT_TRUE(is_problem(gone, ErrorCode::kGone));
  EXPECT_THAT(gone.body, HasSubstr("damaged"));
}

// Labels 1 to 300, so that their list is a file of its own.
RawUpload many_labels() {
  auto volume = constant<std::uint16_t>(0, {9, 9, 9});
  for (std::size_t label = 1; label <= 300; ++label) {
    volume.samples[label] = static_cast<std::uint16_t>(label);
  }
  return {bytes_of(volume.samples), "dims=9,9,9&type=uint16", {}};
}

// Whichever of its files is damaged, and whatever is asked for first.
TEST_F(Damage, AMeshByLabelsIsMadeAgainOnceItsVolumeIsBack) {
  start();
  const Volume uploaded = upload(daemon(), many_labels());
  const std::string& volume = uploaded.id;
  const Answer accepted =
      daemon().send("POST", "/v1/jobs",
                    R"({"volume": ")" + volume +
                        R"(", "labels": "all", "formats": ["stl", "glb"], "lods": [1, 0.5]})",
                    {{"Content-Type", "application/json"}});
  ASSERT_EQ(accepted.status, 202) << accepted.body;
  const Job job = ended(job_from_json(accepted.body).id);
  ASSERT_EQ(job.state, JobState::kSucceeded) << to_json(job);
  const std::string list =
      run_sql("SELECT json_extract(record, '$.mesh.label_list.sha256') FROM jobs WHERE id = '" +
              job.id + "'");
  const std::string walls =
      run_sql("SELECT json_extract(record, '$.mesh.wall_list.sha256') FROM jobs WHERE id = '" +
              job.id + "'");
  const std::string zip = job.mesh->files.at(MeshFormat::kZip).sha256;
  const std::string glb = job.mesh->files.at(MeshFormat::kGlb).sha256;
  const std::string path = "/v1/jobs/" + job.id;
  const auto status = [&](const std::string& request) {
    return daemon().get(path + request).status;
  };
  for (const auto& [blob, request] : {std::pair(list, "/labels"),
                                      {walls, "/walls"},
                                      {list, "/mesh.stl?label=7"},
                                      {zip, "/mesh.stl?label=7"},
                                      {zip, "/mesh.zip"},
                                      {glb, "/mesh.glb"}}) {
    const std::string whole = daemon().get(path + request).body;
    spoil(blob);
    std::filesystem::remove(file_of(uploaded.samples));
    const auto becomes = [&, asked = std::string(request)](int expected) {
      return eventually([&] { return status(asked) == expected; });
    };
    ASSERT_TRUE(becomes(422)) << request;
    EXPECT_THAT(daemon().get(path + request).body, HasSubstr("Upload it again"));
    upload(daemon(), many_labels());
    ASSERT_TRUE(becomes(200)) << request;
    EXPECT_EQ(daemon().get(path + request).body, whole) << request;
  }
}

TEST_F(Damage, NothingIsToldOfASpoiltVolume) {
  start();
  const Volume volume = small_volume();
  spoil(volume.samples);
  const std::string path = "/v1/volumes/" + volume.id;
  for (const std::string& target :
       {path + "/slice.png", path + "/histogram", "/v1/estimate?iso=100&volume=" + volume.id}) {
    const Answer refused = daemon().get(target);
    EXPECT_TRUE(is_problem(refused, ErrorCode::kUnusableVolume)) << target;
    EXPECT_THAT(refused.body, HasSubstr("damaged"));
  }
  small_volume();
  EXPECT_EQ(daemon().get(path + "/slice.png").status, 200);
}

TEST_F(Damage, ABrokenRecordHidesNoOtherVolume) {
  start();
  const Volume broken = small_volume();
  const Volume whole = upload(daemon(), long_upload());
  run_sql("UPDATE volumes SET record = '{\"id\": 3' WHERE id = '" + broken.id + "'");
  for (const std::string query : {"", "?limit=1", "?order=newest", "?order=newest&limit=1"}) {
    const Answer listed = daemon().get("/v1/volumes" + query);
    EXPECT_EQ(listed.status, 200) << query;
    EXPECT_THAT(listed.body, HasSubstr(whole.id)) << query;
    EXPECT_THAT(listed.body, testing::Not(HasSubstr(broken.id))) << query;
  }
  const std::string told = "the record of volume " + broken.id + " is damaged";
  const std::string log = daemon().errors();
  ASSERT_THAT(log, HasSubstr(told));
  EXPECT_EQ(log.find(told), log.rfind(told)) << "it is logged once";
  const Answer alone = daemon().get("/v1/volumes/" + broken.id);
  EXPECT_EQ(alone.status, 500);
  EXPECT_THAT(alone.body, HasSubstr("the record of this volume is damaged"));
  EXPECT_EQ(daemon().send("DELETE", "/v1/volumes/" + broken.id).status, 204);
  EXPECT_EQ(daemon().get("/v1/volumes/" + broken.id).status, 404);
}

// SQLite quotes it.
TEST_F(Damage, OfTheDatabaseIsToldInUtf8) {
  start();
  EXPECT_EQ(daemon().stop(), 0);
  const std::filesystem::path file = folder_ / "data/isomesh.sqlite";
  std::string bytes = read_file(file);
  const std::string table = "tablevolumesvolumes";
  const std::size_t place = bytes.find(table);
  ASSERT_NE(place, std::string::npos);
  bytes[place + 6] = '\xEF';
  write_file(file, bytes);
  for (const char* format : {"text", "json"}) {
    const Finished refused = refused_start(folder_ / "data", {"--log-format", format});
    EXPECT_EQ(refused.status, 1);
    EXPECT_THAT(refused.errors, HasSubstr("malformed database schema"));
    EXPECT_EQ(valid_utf8(refused.errors), refused.errors);
  }
}

}  // namespace
}  // namespace isomesh
