// Pairs of labels that share faces of voxels, and those that only the lattice joins.
#include <algorithm>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "proto/json.h"
#include "tests/api/daemon.h"

namespace isomesh {
namespace {

using namespace test;

// Eight labels of one voxel each, in a cube: each shares a face with three others.
RawUpload eight_voxels() {
  auto volume = constant<std::uint8_t>(0, {6, 6, 6});
  for (std::uint32_t n = 0; n < 8; ++n) {
    volume.at(2 + n % 2, 2 + n / 2 % 2, 2 + n / 4) = static_cast<std::uint8_t>(n + 1);
  }
  return raw_upload(volume);
}

TEST(WallsOfAJob, AreOfLabelsWhoseVoxelsShareFacesUnlessEdgeContactsAreAskedFor) {
  const Daemon daemon;
  const Volume volume = upload(daemon, eight_voxels());
  const Answer answer =
      daemon.send("POST", "/v1/jobs",
                  R"({"labels": "all", "formats": ["stl"], "volume": ")" + volume.id + "\"}",
                  {{"Content-Type", "application/json"}});
  const Job job = daemon.client().wait(job_from_json(answer.body).id);
  ASSERT_EQ(job.state, JobState::kSucceeded) << to_json(job);

  const auto is_of_two = [](const WallSummary& wall) { return wall.b.has_value(); };
  const std::vector<WallSummary> walls = daemon.client().job_walls(job.id);
  EXPECT_EQ(std::ranges::count_if(walls, is_of_two), 12);
  for (const WallSummary& wall : walls) EXPECT_EQ(wall.faces, wall.b ? 1U : 3U) << wall.a;
  EXPECT_EQ(job.mesh->walls_count, walls.size());

  const std::vector<WallSummary> all = daemon.client().job_walls(job.id, true);
  EXPECT_GT(all.size(), walls.size());
  EXPECT_EQ(std::ranges::count_if(all, [](const auto& wall) { return wall.faces > 0U; }), 12 + 8);
  EXPECT_EQ(job.mesh->edge_contacts_count, all.size() - walls.size());
  double area = 0;
  for (const WallSummary& wall : all) area += wall.area_mm2;
  EXPECT_NEAR(area, job.mesh->area_mm2, 1e-6);

  const Finished shown = daemon.command({"--json", "walls", job.id, "--edge-contacts"});
  EXPECT_EQ(walls_from_json(shown.output), all) << shown.errors;
  EXPECT_EQ(daemon.get("/v1/jobs/" + job.id + "/walls?edge_contacts=some").status, 400);
}

}  // namespace
}  // namespace isomesh
