// Labels of a job in pages: from its record, and from a file that may be damaged.
#include "server/jobs/library/label_pages.h"

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "proto/json.h"
#include "tests/support/errors.h"
#include "tests/support/step.h"
#include "tests/support/stores.h"
#include "tests/unit/jobs/fixture.h"

namespace isomesh::jobs {
namespace {

using test::code_thrown_by;

constexpr std::size_t kEntryBytes = 16;

// Every third number, some of them below zero.
std::vector<LabelSummary> some_labels(std::size_t count) {
  std::vector<LabelSummary> labels(count);
  for (std::size_t n = 0; n < count; ++n) {
    labels[n].label = 3 * static_cast<std::int64_t>(n) - 300;
    labels[n].name = "label " + std::to_string(n);
    labels[n].voxels = n + 1;
    labels[n].files[MeshFormat::kStl] = {.bytes = n, .sha256 = "aa", .offset = 7 * n, .href = ""};
  }
  return labels;
}

std::string file_of(const std::vector<LabelSummary>& labels) {
  std::string file;
  write_label_pages(labels, [&](std::span<const std::byte> bytes) {
    file.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  });
  return file;
}

class LabelPagesTest : public test::JobsFixture {
 protected:
  Job job_with(const std::string& file, std::size_t count) {
    const store::Blob blob = test::put(blobs_, file);
    Job job;
    job.id = "x";
    job.mesh.emplace().labels_count = count;
    job.mesh->label_list = {blob.bytes, blob.key};
    return job;
  }

  // Reads all of the list.
  std::vector<LabelSummary> all_of(const Job& job) {
    const JobLabels labels(job, blobs_);
    std::vector<LabelSummary> all;
    std::vector<LabelSummary> page = labels.after(std::nullopt);
    for (; !page.empty(); page = labels.after(page.back().label)) {
      EXPECT_LE(page.size(), MeshSummary::kMostListedLabels);
      all.insert(all.end(), page.begin(), page.end());
    }
    return all;
  }

  std::optional<ErrorCode> code_of(const std::string& file, std::size_t count) {
    const Job job = job_with(file, count);
    return code_thrown_by([&] { all_of(job); });
  }
};

TEST_F(LabelPagesTest, AreThoseThatWereWritten) {
  for (const std::size_t count : {257U, 511U, 512U, 513U, 1000U}) {
    std::vector<LabelSummary> labels = some_labels(count);
    const Job stored = job_with(file_of(labels), count);
    Job recorded;
    recorded.id = "x";
    recorded.mesh.emplace().labels = labels;
    for (LabelSummary& label : labels) {
      label.files[MeshFormat::kStl].href = mesh_path("x", MeshFormat::kStl, label.label);
    }
    EXPECT_EQ(all_of(stored), labels) << count;
    EXPECT_EQ(all_of(recorded), labels) << count;
    EXPECT_EQ(JobLabels(stored, blobs_).count(), count);
    EXPECT_EQ(JobLabels(recorded, blobs_).count(), count);
  }
}

TEST_F(LabelPagesTest, AreFoundByTheirValue) {
  const std::vector<LabelSummary> written = some_labels(600);
  const Job job = job_with(file_of(written), 600);
  const JobLabels labels(job, blobs_);
  for (std::size_t n = 0; n < written.size(); n += test::kStep) {
    EXPECT_EQ(labels.find(written[n].label)->voxels, written[n].voxels);
    EXPECT_FALSE(labels.find(written[n].label + 1));
  }
  EXPECT_FALSE(labels.find(-301));
  EXPECT_FALSE(labels.find(std::numeric_limits<std::int64_t>::min()));
  EXPECT_FALSE(labels.find(std::numeric_limits<std::int64_t>::max()));
}

TEST_F(LabelPagesTest, GoOnAfterAnyValue) {
  const Job job = job_with(file_of(some_labels(600)), 600);
  const JobLabels labels(job, blobs_);
  EXPECT_EQ(labels.after(-1000).front().label, -300);
  EXPECT_EQ(labels.after(-299).front().label, -297);
  EXPECT_EQ(labels.after(-299).size(), 255U);
  EXPECT_EQ(labels.after(-300 + 3 * 255).front().label, -300 + 3 * 256);
  EXPECT_TRUE(labels.after(-300 + 3 * 599).empty());
}

TEST_F(LabelPagesTest, OfAJobWithoutLabelsAreNone) {
  Job job;
  job.mesh.emplace();
  const JobLabels labels(job, blobs_);
  EXPECT_EQ(labels.count(), 0U);
  EXPECT_TRUE(labels.after(std::nullopt).empty());
  EXPECT_FALSE(labels.find(1));
}

// The process that writes the file may have been taken over.
TEST_F(LabelPagesTest, OfADamagedFileAreRejected) {
  const std::string file = file_of(some_labels(600));
  EXPECT_FALSE(code_of(file, 600));
  for (const std::size_t count : {0U, 1U, 256U, 512U, 599U, 601U, 769U, 65536U}) {
    EXPECT_EQ(code_of(file, count), ErrorCode::kInternal) << count;
  }
  EXPECT_EQ(code_of(file, std::numeric_limits<std::size_t>::max()), ErrorCode::kInternal);
  for (const std::size_t length :
       {std::size_t{0}, 3 * kEntryBytes, file.size() / 2, file.size() - 1}) {
    EXPECT_EQ(code_of(file.substr(0, length), 600), ErrorCode::kInternal) << length;
  }
  for (std::size_t at = file.size() - 3 * kEntryBytes; at < file.size(); ++at) {
    std::string damaged = file;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x80);
    EXPECT_EQ(code_of(damaged, 600), ErrorCode::kInternal) << at;
  }
  std::string other = file;
  other.replace(other.find("\"label\":-300"), 12, "\"label\":-200");
  EXPECT_EQ(code_of(other, 600), ErrorCode::kInternal);
  std::string text = file;
  text[0] = '[';
  EXPECT_EQ(code_of(text, 600), ErrorCode::kInternal);
  Job missing = job_with(file, 600);
  blobs_.erase(missing.mesh->label_list->sha256);
  EXPECT_EQ(code_thrown_by([&] { all_of(missing); }), ErrorCode::kNotFound);
}

// Jobs of older servers have walls without faces, and list all of them.
TEST_F(LabelPagesTest, WallsWithoutFacesAreReadToo) {
  Job job = job_with(file_of(some_labels(600)), 600);
  job.parameters.labels.emplace();
  job.mesh->walls_count = 1;
  std::string file(24, '\0');
  file[0] = 2;
  file[22] = '\xf0';  // 1.0
  file[23] = '\x3f';
  const store::Blob blob = test::put(blobs_, file);
  job.mesh->wall_list = {blob.bytes, blob.key};
  const WallSummary wall = {.a = -297, .area_mm2 = 1, .a_name = "label 1"};
  EXPECT_EQ(walls_of(job, 0, false, blobs_).walls, std::vector{wall});
}

// Every third is between labels that share no face.
std::vector<mesh::WallArea> some_walls() {
  std::vector<mesh::WallArea> walls(450);
  for (std::size_t n = 0; n < walls.size(); ++n) {
    walls[n] = {n + 1, n % 2 == 0 ? 0U : 600U, static_cast<double>(n) / 4, n % 3};
  }
  return walls;
}

std::string file_of(std::span<const mesh::WallArea> walls) {
  std::string file;
  write_walls(walls, [&](std::span<const std::byte> bytes) {
    file.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  });
  return file;
}

class WallPagesTest : public LabelPagesTest {
 protected:
  void keep(const std::string& file) {
    const store::Blob blob = test::put(blobs_, file);
    job_.mesh->wall_list = {blob.bytes, blob.key};
  }

  // Their first labels, from all pages.
  std::vector<std::int64_t> all_walls(bool edge_contacts) {
    std::vector<std::int64_t> labels;
    for (std::optional<std::uint64_t> at = 0; at;) {
      const WallPage page = walls_of(job_, *at, edge_contacts, blobs_);
      for (const WallSummary& wall : page.walls) labels.push_back(wall.a);
      at = page.next;
    }
    return labels;
  }

  void SetUp() override {
    job_.parameters.labels.emplace();
    job_.mesh->walls_count = 300;
    job_.mesh->edge_contacts_count = 150;
  }

  Job job_ = job_with(file_of(some_labels(600)), 600);
};

// Every wall that is read is checked.
TEST_F(WallPagesTest, ReadEdgeContactsOnlyIfAskedFor) {
  constexpr std::size_t kWallBytes = 32;
  std::string file = file_of(some_walls());
  keep(file);
  EXPECT_EQ(all_walls(true).size(), 450U);
  for (std::size_t at = 300 * kWallBytes; at < file.size(); at += kWallBytes) {
    std::fill_n(&file[at + 8], 8, '\x7f');  // no such label
  }
  keep(file);
  EXPECT_EQ(all_walls(false).size(), 300U);
  EXPECT_EQ(code_thrown_by([&] { all_walls(true); }), ErrorCode::kInternal);
}

// Older servers wrote walls and edge contacts in one order.
TEST_F(WallPagesTest, AreTheSameFromAnOlderFile) {
  const std::vector<mesh::WallArea> walls = some_walls();
  keep(file_of(walls));
  const auto expected = all_walls(false);
  std::string older;
  for (const mesh::WallArea& wall : walls) older += file_of(std::span(&wall, 1));
  keep(older);
  EXPECT_EQ(all_walls(false), expected);
  EXPECT_EQ(all_walls(true).size(), walls.size());
}

TEST_F(WallPagesTest, TellTheirLabels) {
  const std::string file = file_of(some_walls());
  keep(file);
  const auto expect_page = [&](std::uint64_t begin, bool edge_contacts, std::size_t count,
                               std::optional<std::uint64_t> next) {
    const WallPage page = walls_of(job_, begin, edge_contacts, blobs_);
    EXPECT_EQ(page.walls.size(), count);
    EXPECT_EQ(page.next, next);
    const bool has_any = std::ranges::count(page.walls, 0U, &WallSummary::faces) > 0;
    EXPECT_EQ(has_any, edge_contacts && count > 0 && begin + count > 300);
  };
  expect_page(0, false, 256, 256);
  expect_page(256, false, 44, std::nullopt);
  expect_page(450, false, 0, std::nullopt);
  expect_page(0, true, 256, 256);
  expect_page(256, true, 194, std::nullopt);
  expect_page(450, true, 0, std::nullopt);
  const auto both = walls_of(job_, 298, false, blobs_).walls;
  const WallSummary alone = {-300 + 3 * 448, std::nullopt, 112, 1, "label 448", std::nullopt};
  const WallSummary last = {-300 + 3 * 449, -300 + 3 * 599, 112.25, 2, "label 449", "label 599"};
  EXPECT_EQ(both, (std::vector{alone, last}));

  const auto code = [&] { return code_thrown_by([&] { walls_of(job_, 0, true, blobs_); }); };
  keep(file.substr(1));
  EXPECT_EQ(code(), ErrorCode::kInternal);
  for (const auto& [at, byte] : {std::pair(0, 0), {1, 0x7f}, {9, 0x7f}, {22, 0xff}}) {
    std::string damaged = file;  // no label, labels that there are not, an area that is none
    damaged[static_cast<std::size_t>(at)] = static_cast<char>(byte);
    if (at == 22) damaged[23] = '\x7f';
    keep(damaged);
    EXPECT_EQ(code(), ErrorCode::kInternal) << at;
  }
  job_.mesh->walls_count.reset();
  job_.mesh->wall_list.reset();
  EXPECT_EQ(code(), ErrorCode::kNotFound);
  job_.parameters.labels.reset();
  EXPECT_FALSE(code());
}

}  // namespace
}  // namespace isomesh::jobs
