// Jobs by labels over HTTP: from the list of a volume's labels to one label's own file.
#include <cmath>
#include <cstring>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/sha256.h"
#include "proto/json.h"
#include "tests/api/daemon.h"
#include "tests/api/problems.h"
#include "tests/support/files.h"
#include "tests/support/process.h"

namespace isomesh {
namespace {

using namespace test;
using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

// Two balls that touch, of the labels 3 and 7.
RawUpload two_balls() {
  auto volume = constant<std::uint8_t>(0, {30, 20, 20});
  for (std::uint32_t k = 0; k < 20; ++k) {
    for (std::uint32_t j = 0; j < 20; ++j) {
      for (std::uint32_t i = 0; i < 30; ++i) {
        if (std::hypot(i - 9.0, j - 10.0, k - 10.0) < 6) volume.at(i, j, k) = 3;
        if (std::hypot(i - 19.0, j - 10.0, k - 10.0) < 6) volume.at(i, j, k) = 7;
      }
    }
  }
  return raw_upload(volume);
}

class LabelsTest : public testing::Test {
 protected:
  Answer post(const std::string& members, const std::string& volume = {}) const {
    return daemon_.send("POST", "/v1/jobs",
                        R"({"volume": ")" + (volume.empty() ? volume_.id : volume) + "\"" +
                            (members.empty() ? "" : ", " + members) + "}",
                        {{"Content-Type", "application/json"}});
  }

  Job made(const std::string& members) const {
    const Answer answer = post(members);
    EXPECT_EQ(answer.status, 202) << answer.body;
    const Job job = daemon_.client().wait(job_from_json(answer.body).id);
    EXPECT_EQ(job.state, JobState::kSucceeded) << to_json(job);
    return job;
  }

  Answer mesh(const Job& job, const std::string& name, const Headers& headers = {}) const {
    return daemon_.get("/v1/jobs/" + job.id + "/mesh." + name, headers);
  }

  Daemon daemon_;
  const RawUpload balls_ = two_balls();
  const Volume volume_ = upload(daemon_, balls_);
};

// A mask of a cube of 2 x 2 x 2 samples, as NRRD; `inside` is their value.
std::string mask_nrrd(char inside = '\1') {
  std::string samples(1000, '\0');
  for (const std::size_t at : {444, 445, 454, 455, 544, 545, 554, 555}) samples[at] = inside;
  return "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 10 10 10\nspacings: 1 1 1\nencoding: "
         "raw\n\n" +
         samples;
}

TEST_F(LabelsTest, AMaskAtAnIsoValueIsAdvisedToUseLabels) {
  const TemporaryFolder folder;
  write_file(folder / "mask.nrrd", mask_nrrd());
  const Finished made =
      daemon_.command({"mesh", folder / "mask.nrrd", "--iso", "0.5", "-o", folder / "mask.glb"});
  EXPECT_EQ(made.status, 0) << made.errors;
  EXPECT_THAT(made.errors, HasSubstr("note: The samples are a mask: each is 0 or 1."));
  EXPECT_THAT(made.errors, HasSubstr("--labels all"));
  EXPECT_THAT(made.errors, HasSubstr("(looks-like-labels)"));

  const Finished followed = daemon_.command(
      {"mesh", folder / "mask.nrrd", "--labels", "all", "--close", "-o", folder / "mask.glb"});
  EXPECT_EQ(followed.status, 0) << followed.errors;
  EXPECT_EQ(followed.errors.find("looks-like-labels"), std::string::npos) << followed.errors;
}

TEST_F(LabelsTest, AFolderOfMasksIsAdvisedToBeOneVolume) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "masks");
  write_file(folder / "masks/left.nrrd", mask_nrrd());
  write_file(folder / "masks/right.nrrd", mask_nrrd('\2'));
  const Finished refused = daemon_.command(
      {"mesh", folder / "masks", "--labels", "all", "--close", "-o", folder / "mask.glb"});
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.errors, HasSubstr("if they are masks, --masks makes one surface of each"));
  const Finished made =
      daemon_.command({"mesh", folder / "masks", "--masks", "--close", "-o", folder / "mask.glb"});
  EXPECT_EQ(made.status, 0) << made.errors;
}

TEST_F(LabelsTest, AJobSaysWhatEveryLabelIs) {
  const Job job = made(R"("labels": "all", "close": true, "formats": ["glb", "stl"],
                          "label_names": {"3": "Left"}, "label_colors": {"7": "#FF8000"})");
  EXPECT_EQ(job.parameters.passes, 10);
  EXPECT_EQ(job.parameters.smoothing, Smoothing::kLabels);
  EXPECT_TRUE(job.parameters.regularize);
  EXPECT_FALSE(job.parameters.max_displacement_mm);
  const json parameters = json::parse(to_json(job.parameters));
  EXPECT_FALSE(parameters.contains("iso"));
  EXPECT_FALSE(parameters.contains("interpolation"));
  EXPECT_EQ(parameters["labels"], "all");
  ASSERT_EQ(job.mesh->labels.size(), 2U);
  const LabelSummary& left = job.mesh->labels[0];
  EXPECT_EQ(left.label, 3);
  EXPECT_EQ(left.name, "Left");
  EXPECT_FALSE(left.color);
  EXPECT_TRUE(left.closed && left.manifold && left.oriented);
  EXPECT_EQ(job.mesh->labels[1].color, "#ff8000");
  EXPECT_EQ(job.mesh->files.size(), 2U);

  const json list = json::parse(daemon_.get("/v1/jobs").body);
  EXPECT_FALSE(list["jobs"][0]["mesh"].contains("labels"));
  EXPECT_TRUE(list["jobs"][0]["parameters"]["label_names"].empty());
}

TEST_F(LabelsTest, OneLabelsFileIsAFileOfItsOwn) {
  const Job job = made(R"("labels": "all", "formats": ["stl", "ply"])");
  const LabelSummary& label = job.mesh->labels[1];
  const LabelFile& file = label.files.at(MeshFormat::kStl);
  EXPECT_EQ(file.href, "/v1/jobs/" + job.id + "/mesh.stl?label=7");
  const Answer answer = mesh(job, "stl?label=7");
  EXPECT_EQ(answer.status, 200);
  EXPECT_EQ(answer.header("content-type"), "model/stl");
  EXPECT_EQ(answer.header("etag"), '"' + file.sha256 + '"');
  EXPECT_THAT(answer.header("content-disposition"), HasSubstr("mesh-7.stl"));
  EXPECT_EQ(answer.body.size(), file.bytes);
  EXPECT_EQ(sha256_of(answer.body), file.sha256);
  std::uint32_t triangles = 0;
  std::memcpy(&triangles, answer.body.data() + 80, sizeof triangles);
  EXPECT_EQ(triangles, label.triangles);

  const Answer part = mesh(job, "stl?label=7", {{"Range", "bytes=80-83"}});
  EXPECT_EQ(part.status, 206);
  EXPECT_EQ(part.body, answer.body.substr(80, 4));
  EXPECT_EQ(part.header("content-range"), "bytes 80-83/" + std::to_string(file.bytes));
  EXPECT_EQ(mesh(job, "stl?label=7", {{"If-None-Match", answer.header("etag")}}).status, 304);

  EXPECT_EQ(mesh(job, "ply").status, 200);
  EXPECT_EQ(mesh(job, "ply?label=3").status, 200);
  const Answer zip = mesh(job, "zip");
  EXPECT_EQ(zip.status, 200);
  EXPECT_EQ(zip.header("content-type"), "application/zip");
  EXPECT_EQ(zip.body.substr(file.offset, file.bytes), answer.body);
}

TEST_F(LabelsTest, TheMaterialsOfAnObjAreBesideIt) {
  const Job job = made(
      R"("labels": "all", "formats": ["obj"], "label_names": {"7": "Right side"},
         "label_colors": {"7": "#ff0080"})");
  const Answer materials = mesh(job, "mtl");
  EXPECT_EQ(materials.status, 200);
  EXPECT_EQ(materials.header("content-type"), "model/mtl");
  EXPECT_THAT(materials.header("content-disposition"), HasSubstr("mesh.mtl"));
  EXPECT_THAT(materials.body, HasSubstr("newmtl label_3\nKd 0."));
  EXPECT_THAT(materials.body, HasSubstr("newmtl Right_side\nKd 1.000000 0.000000 0.501961\n"));
  const Answer same = mesh(job, "mtl", {{"If-None-Match", materials.header("etag")}});
  EXPECT_EQ(same.status, 304);
  EXPECT_EQ(same.header("content-disposition"), "");
  const Answer head = daemon_.send("HEAD", "/v1/jobs/" + job.id + "/mesh.mtl");
  EXPECT_EQ(head.status, 200);
  EXPECT_EQ(head.body, "");
  EXPECT_EQ(head.header("content-length"), std::to_string(materials.body.size()));
  EXPECT_EQ(head.header("etag"), materials.header("etag"));
  EXPECT_THAT(mesh(job, "obj").body, HasSubstr("\nmtllib mesh.mtl\n"));
  const Job surface = finished_job(daemon_);
  EXPECT_EQ(mesh(surface, "mtl").status, 200);
  EXPECT_EQ(mesh(surface, "mtl").body, "");
}

TEST_F(LabelsTest, AGiftiIsOfferedByANameThatTellsThatItIsASurface) {
  const Job job = made(R"("labels": "all", "formats": ["gii"])");
  EXPECT_THAT(mesh(job, "gii?label=7").header("content-disposition"),
              HasSubstr("\"mesh-7.surf.gii\""));
}

TEST_F(LabelsTest, WhatHoldsOneLabelHasToBeToldWhich) {
  const Job job = made(R"("labels": "all", "formats": ["stl"], "label_names": {"7": "Right"})");
  const Answer which = mesh(job, "stl");
  EXPECT_EQ(which.status, 400);
  EXPECT_THAT(which.body, HasSubstr("3, 7 (Right)"));
  EXPECT_EQ(mesh(job, "stl?label=4").status, 400);
  EXPECT_EQ(mesh(job, "stl?label=x").status, 400);
  EXPECT_EQ(mesh(job, "drc?label=7").status, 404);
  EXPECT_EQ(mesh(job, "glb").status, 404);
  const Job one = made(R"("labels": [7], "formats": ["stl"])");
  EXPECT_EQ(mesh(one, "stl").body.size(), one.mesh->labels[0].files.at(MeshFormat::kStl).bytes);
  EXPECT_EQ(mesh(finished_job(daemon_), "drc?label=1").status, 400);
}

TEST_F(LabelsTest, AnotherBackgroundIsAnotherMesh) {
  const Job job = made(R"("labels": "all", "background": 3, "formats": ["zip"])");
  ASSERT_EQ(job.mesh->labels.size(), 2U);
  EXPECT_EQ(job.mesh->labels[0].label, 0);
  EXPECT_EQ(job.mesh->labels[1].label, 7);
}

TEST_F(LabelsTest, AnEstimateIsExact) {
  const Answer answer =
      daemon_.get("/v1/estimate?volume=" + volume_.id + "&labels=3,7&format=glb,stl");
  ASSERT_EQ(answer.status, 200) << answer.body;
  const Estimate estimate = estimate_from_json(answer.body);
  const Job job = made(R"("labels": [3, 7], "formats": ["glb", "stl"])");
  EXPECT_EQ(estimate.triangles, job.mesh->triangles);
  ASSERT_EQ(estimate.labels.size(), 2U);
  EXPECT_EQ(estimate.labels[1].triangles, job.mesh->labels[1].triangles);
}

TEST_F(LabelsTest, OneRequestMakesAFileOfAllLabels) {
  const auto mesh_of = [&](const std::string& query) {
    return daemon_.send("POST", "/v1/mesh?" + balls_.query + '&' + query, balls_.bytes,
                        {{"Content-Type", "application/octet-stream"}});
  };
  EXPECT_EQ(mesh_of("labels=all&format=glb").body.substr(0, 4), "glTF");
  EXPECT_EQ(mesh_of("labels=all&format=ply").body.substr(0, 4), "ply\n");
  EXPECT_EQ(mesh_of("labels=all&format=obj").body.substr(0, 9), "# isomesh");
  EXPECT_EQ(mesh_of("labels=all&format=zip").body.substr(0, 2), "PK");
  EXPECT_EQ(mesh_of("labels=7&format=stl").body.substr(0, 7), "isomesh");
  EXPECT_EQ(mesh_of("labels=all&format=stl").status, 400);
}

// Labels 1 to 1000, each of as many voxels as its number has digits.
class ManyLabelsTest : public LabelsTest {
 protected:
  static constexpr std::int64_t kLabels = 1000;

  static RawUpload thousand_labels() {
    auto volume = constant<std::uint16_t>(0, {20, 20, 20});
    std::size_t at = 0;
    for (std::int64_t label = 1; label <= kLabels; ++label) {
      for (std::size_t n = 0; n < std::to_string(label).size(); ++n) {
        volume.samples[at++] = static_cast<std::uint16_t>(label);
      }
    }
    return {bytes_of(volume.samples), "dims=20,20,20&type=uint16", {}};
  }

  Answer page(const std::string& query = {}) const {
    return daemon_.get("/v1/jobs/" + job_.id + "/labels" + query);
  }

  Job made_of_many() const {
    const Answer answer =
        post(R"("labels": "all", "formats": ["stl"], "label_names": {"700": "x"})",
             upload(daemon_, thousand_labels()).id);
    EXPECT_EQ(answer.status, 202) << answer.body;
    return daemon_.client().wait(job_from_json(answer.body).id);
  }

  const Job job_ = made_of_many();
};

TEST_F(ManyLabelsTest, OfTheVolumeAreListedInPages) {
  const std::string path = "/v1/volumes/" + job_.parameters.volume + "/labels";
  std::int64_t last = 0;
  std::size_t pages = 0;
  for (std::string query = "?background=0"; !query.empty(); ++pages) {
    const Answer answer = daemon_.get(path + query);
    ASSERT_EQ(answer.status, 200) << answer.body;
    const VolumeLabels page = volume_labels_from_json(answer.body);
    EXPECT_LE(page.labels.size(), MeshSummary::kMostListedLabels);
    for (const VolumeLabel& label : page.labels) EXPECT_EQ(label.label, ++last);
    query = page.next ? "?cursor=" + *page.next : "";
  }
  EXPECT_EQ(last, kLabels);
  EXPECT_EQ(pages, 4U);
  EXPECT_EQ(daemon_.client().labels(job_.parameters.volume).labels.size(), kLabels);
  const json jobs = json::parse(page().body);
  for (const std::string& wrong : {std::string("1"), jobs["next"].get<std::string>()}) {
    EXPECT_TRUE(blames(daemon_.get(path + "?cursor=" + wrong), "cursor")) << wrong;
  }
}

TEST_F(ManyLabelsTest, AnEstimateTellsTheirNumber) {
  const std::string path = "/v1/estimate?format=stl&volume=" + job_.parameters.volume + "&labels=";
  const Estimate all = estimate_from_json(daemon_.get(path + "all").body);
  EXPECT_EQ(all.labels_count, kLabels);
  EXPECT_TRUE(all.labels.empty());
  EXPECT_EQ(all.triangles, job_.mesh->triangles);
  const Estimate some = estimate_from_json(daemon_.get(path + "1,2").body);
  EXPECT_EQ(some.labels.size(), 2U);
  EXPECT_FALSE(some.labels_count);
}

TEST_F(ManyLabelsTest, AreListedInPages) {
  ASSERT_EQ(job_.state, JobState::kSucceeded) << to_json(job_);
  std::int64_t last = 0;
  std::size_t pages = 0;
  std::string query;
  do {
    const Answer answer = page(query);
    ASSERT_EQ(answer.status, 200) << answer.body;
    const auto labels = labels_from_json(answer.body);
    EXPECT_EQ(labels.size(), ++pages < 4 ? 256U : 232U);
    for (const LabelSummary& label : labels) {
      EXPECT_EQ(label.label, ++last);
      EXPECT_EQ(label.voxels, std::to_string(label.label).size());
      EXPECT_EQ(label.name.has_value(), label.label == 700);
      EXPECT_EQ(label.files.at(MeshFormat::kStl).href,
                "/v1/jobs/" + job_.id + "/mesh.stl?label=" + std::to_string(label.label));
    }
    const json next = json::parse(answer.body)["next"];
    query = next.is_null() ? "" : "?cursor=" + next.get<std::string>();
  } while (!query.empty());
  EXPECT_EQ(last, kLabels);
  EXPECT_EQ(pages, 4U);
  for (const char* wrong : {"?cursor=", "?cursor=1", "?cursor=6c6162656c733a78", "?x=1"}) {
    EXPECT_EQ(page(wrong).status, 400) << wrong;
  }
}

TEST_F(ManyLabelsTest, MakeNoAnswerLong) {
  for (const std::string path : {"", "?wait=1", "/events"}) {
    const Answer answer = daemon_.get("/v1/jobs/" + job_.id + path);
    EXPECT_THAT(answer.body, HasSubstr("\"labels_count\":1000")) << path;
    EXPECT_LT(answer.body.size(), std::size_t{64} << 10) << path;
    EXPECT_EQ(answer.body.find("label_list"), std::string::npos) << path;
  }
  const json mesh = json::parse(daemon_.get("/v1/jobs/" + job_.id).body)["mesh"];
  EXPECT_FALSE(mesh.contains("labels"));
}

TEST_F(ManyLabelsTest, HaveTheMaterialsThatTheirObjUses) {
  const Answer asked =
      post(R"("labels": "all", "formats": ["obj"], "label_names": {"700": "x", "900": "x"})",
           job_.parameters.volume);
  ASSERT_EQ(asked.status, 202) << asked.body;
  const Job job = daemon_.client().wait(job_from_json(asked.body).id);
  const auto names_after = [](const std::string& key, const std::string& text) {
    std::vector<std::string> names;
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
      if (line.starts_with(key)) names.push_back(line.substr(key.size()));
    }
    return names;
  };
  const auto made = names_after("newmtl ", mesh(job, "mtl").body);
  EXPECT_EQ(std::ssize(made), kLabels);
  EXPECT_EQ(made, names_after("usemtl ", mesh(job, "obj").body));
}

TEST_F(ManyLabelsTest, HaveFilesOfTheirOwn) {
  const Answer file = mesh(job_, "stl?label=700");
  EXPECT_EQ(file.status, 200);
  const Answer etag = page("?cursor=" + json::parse(page().body)["next"].get<std::string>());
  EXPECT_EQ(labels_from_json(etag.body).front().label, 257);
  EXPECT_EQ(mesh(job_, "stl?label=1001").status, 400);
  EXPECT_THAT(mesh(job_, "stl").body, HasSubstr("50 and 950 more"));
  EXPECT_EQ(mesh(job_, "ply").status, 404);
  const TemporaryFolder folder;
  daemon_.client().fetch(job_.id, MeshFormat::kStl, folder / "700.stl", {}, 700);
  EXPECT_EQ(read_file(folder / "700.stl"), file.body);
  const Finished report = daemon_.command({"status", job_.id});
  EXPECT_EQ(report.status, 0) << report.errors;
  EXPECT_THAT(report.output, HasSubstr(" 700  x "));
  EXPECT_THAT(report.output, HasSubstr(" 1000  "));
}

TEST_F(LabelsTest, FewAreAPageToo) {
  const Job job = made(R"("labels": "all", "formats": ["stl"])");
  const Answer answer = daemon_.get("/v1/jobs/" + job.id + "/labels");
  EXPECT_EQ(answer.status, 200);
  EXPECT_EQ(labels_from_json(answer.body), job.mesh->labels);
  EXPECT_TRUE(json::parse(answer.body)["next"].is_null());
  const Answer none = daemon_.get("/v1/jobs/" + finished_job(daemon_).id + "/labels");
  EXPECT_EQ(none.status, 200);
  EXPECT_TRUE(labels_from_json(none.body).empty());
}

TEST_F(LabelsTest, HaveTheAreasOfTheirWalls) {
  const Job job = made(R"("labels": "all", "formats": ["stl"], "label_names": {"7": "Right"})");
  const Answer answer = daemon_.get("/v1/jobs/" + job.id + "/walls");
  ASSERT_EQ(answer.status, 200) << answer.body;
  const std::vector<WallSummary> walls = walls_from_json(answer.body);
  ASSERT_EQ(job.mesh->walls_count, walls.size());
  std::map<std::int64_t, double> areas;
  double all = 0;
  for (const WallSummary& wall : walls) {
    areas[wall.a] += wall.area_mm2;
    if (wall.b) areas[*wall.b] += wall.area_mm2;
    all += wall.area_mm2;
    EXPECT_GT(wall.faces, 0U);
    EXPECT_EQ(wall.a_name.value_or(""), wall.a == 7 ? "Right" : "");
    EXPECT_EQ(wall.b_name.value_or(""), wall.b == 7 ? "Right" : "");
  }
  EXPECT_FALSE(walls.front().b);  // the background comes first
  for (const LabelSummary& label : job.mesh->labels) {
    EXPECT_NEAR(areas[label.label], label.area_mm2, 1e-3);
  }
  EXPECT_NEAR(all, job.mesh->area_mm2, 1e-3);
  EXPECT_EQ(daemon_.client().job_walls(job.id), walls);
  const Finished shown = daemon_.command({"walls", job.id});
  EXPECT_EQ(shown.status, 0) << shown.errors;
  EXPECT_THAT(shown.output, HasSubstr("background"));
  const Finished as_json = daemon_.command({"--json", "walls", job.id});
  EXPECT_EQ(walls_from_json(as_json.output), walls);
  const Answer none = daemon_.get("/v1/jobs/" + finished_job(daemon_).id + "/walls");
  EXPECT_EQ(none.status, 200);
  EXPECT_TRUE(walls_from_json(none.body).empty());
}

TEST_F(ManyLabelsTest, ListTheirWallsInPages) {
  const std::string path = "/v1/jobs/" + job_.id + "/walls";
  std::vector<WallSummary> walls;
  std::string query;
  do {
    const Answer answer = daemon_.get(path + query);
    ASSERT_EQ(answer.status, 200) << answer.body;
    const auto page = walls_from_json(answer.body);
    EXPECT_LE(page.size(), 256U);
    walls.insert(walls.end(), page.begin(), page.end());
    const json next = json::parse(answer.body)["next"];
    query = next.is_null() ? "" : "?cursor=" + next.get<std::string>();
  } while (!query.empty());
  EXPECT_EQ(walls.size(), job_.mesh->walls_count);
  EXPECT_GT(walls.size(), std::size_t{kLabels});
  for (std::size_t n = 1; n < walls.size(); ++n) {
    ASSERT_LT(std::pair(walls[n - 1].a, walls[n - 1].b), std::pair(walls[n].a, walls[n].b));
  }
  EXPECT_EQ(daemon_.client().job_walls(job_.id), walls);
  const auto named = std::ranges::find(walls, 700, &WallSummary::a);
  ASSERT_NE(named, walls.end());
  EXPECT_EQ(named->a_name, "x");
  for (const char* wrong : {"?cursor=", "?cursor=1", "?cursor=77616c6c733a2d31", "?x=1"}) {
    EXPECT_EQ(daemon_.get(path + wrong).status, 400) << wrong;  // the last long one is "walls:-1"
  }
}

TEST_F(LabelsTest, TheCommandWritesThem) {
  const TemporaryFolder folder;
  write_file(folder / "balls.raw", balls_.bytes);
  const auto mesh_with = [&](const std::vector<std::string>& more) {
    return daemon_.command(with(with({"mesh", folder / "balls.raw"}, balls_.options), more));
  };
  const Finished all = mesh_with({"--labels", "all", "--label-name", "3=Left lung", "-o",
                                  folder / "body.glb", "-o", folder / "body.zip"});
  EXPECT_EQ(all.status, 0) << all.errors;
  EXPECT_THAT(all.output, HasSubstr("Left lung"));
  EXPECT_EQ(read_file(folder / "body.zip").substr(0, 2), "PK");
  EXPECT_THAT(read_file(folder / "body.zip"), HasSubstr("Left lung.stl"));
  const Finished one = mesh_with({"--labels", "7", "-o", folder / "right.stl"});
  EXPECT_EQ(one.status, 0) << one.errors;
  EXPECT_EQ(read_file(folder / "right.stl").substr(0, 7), "isomesh");
  EXPECT_EQ(mesh_with({"--labels", "all", "-o", folder / "all.stl"}).status, 2);
  EXPECT_EQ(mesh_with({"--iso", "3", "-o", folder / "all.zip"}).status, 2);
  EXPECT_EQ(mesh_with({"--iso", "3", "--labels", "all", "-o", folder / "all.glb"}).status, 2);
  EXPECT_EQ(mesh_with({"-o", folder / "all.glb"}).status, 2);
  const Finished missing = mesh_with({"--labels", "5", "-o", folder / "five.glb"});
  EXPECT_EQ(missing.status, 1);
  EXPECT_THAT(missing.errors, HasSubstr("5"));
}

}  // namespace
}  // namespace isomesh
