// Tests of uploads that the daemon keeps, so that they can be read with other options.
#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/isomesh/package.h"
#include "proto/json.h"
#include "tests/api/daemon.h"
#include "tests/api/problems.h"
#include "tests/unit/import/writers.h"

namespace isomesh::test {
namespace {

using import::test::nifti;
using testing::Contains;
using testing::Field;

const std::string kSamples = "abcdefghijklmnopqrstuvwx";  // 4 x 3 x 2

std::string nrrd(const std::string& samples) {
  return "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 4 3 2\nencoding: raw\n\n" + samples;
}

// Two volumes.
std::string two_times() { return nifti({.dim = {4, 2, 3, 2, 2, 1, 1, 1}}, kSamples); }

class KeptTest : public testing::Test {
 protected:
  // A folder as clients pack it: this file, and one of one volume.
  std::string folder_with(const std::string& name, const std::string& content) const {
    const std::filesystem::path folder = folder_ / "kept";
    std::filesystem::create_directory(folder);
    write_file(folder / name, content);
    write_file(folder / "b.nrrd", nrrd(kSamples));
    const UploadBody body(folder);
    std::string bytes(body.size(), '\0');
    body.read(0, bytes);
    return bytes;
  }

  std::string folder_of_two() const { return folder_with("a.nii", two_times()); }

  // Sends the file as a resumable upload that becomes a volume, and returns the upload's name.
  std::string resumed(const std::string& query, const std::string& file) const {
    const std::string place =
        daemon_.send("POST", "/v1/volumes?" + query, {}, {{"Upload-Complete", "?0"}})
            .header("location");
    const Answer last = daemon_.send("PATCH", place, file,
                                     {{"Content-Type", "application/partial-upload"},
                                      {"Upload-Offset", "0"},
                                      {"Upload-Complete", "?1"}});
    EXPECT_EQ(last.status, 201) << last.body;
    return place.substr(place.rfind('/') + 1);
  }

  const Daemon daemon_;
  const TemporaryFolder folder_;
};

TEST_F(KeptTest, ARefusedUploadIsKeptForWhoWantsToChoose) {
  const std::string file = two_times();
  EXPECT_EQ(daemon_.send("POST", "/v1/volumes", file).header("isomesh-upload"), "");
  const Answer open = daemon_.send("POST", "/v1/volumes?keep=true", file,
                                   {{"Content-Disposition", "attachment; filename=\"t.nii\""}});
  EXPECT_EQ(open.status, 422);
  const std::string kept = open.header("isomesh-upload");
  ASSERT_EQ(kept.size(), 32U);
  const std::string again = "/v1/volumes?keep=true&upload=" + kept;
  EXPECT_EQ(daemon_.send("POST", again).header("isomesh-upload"), kept);
  EXPECT_EQ(daemon_.send("POST", again + "&volume=1", "a body").status, 400);
  EXPECT_EQ(daemon_.send("POST", "/v1/volumes?keep=maybe", file).status, 400);
  const Answer chosen = daemon_.send("POST", again + "&volume=1");
  ASSERT_EQ(chosen.status, 201) << chosen.body;
  const Volume volume = volume_from_json(chosen.body);
  EXPECT_EQ(volume.name, "t.nii");
  EXPECT_THAT(volume.notes, Contains(Field(&Note::code, "volume-chosen")));
  const Answer other = daemon_.send("POST", again + "&volume=0");
  EXPECT_EQ(other.status, 201) << other.body;
  EXPECT_NE(volume_from_json(other.body).id, volume.id);

  // An upload that no option can fix is not kept. Raw data is kept, because options can describe
  // it.
  EXPECT_EQ(daemon_.send("POST", "/v1/volumes?keep=true", nrrd("few")).header("isomesh-upload"),
            "");
  const Answer raw = daemon_.send("POST", "/v1/volumes?keep=true", std::string(24, 'a'));
  EXPECT_EQ(raw.status, 415);
  const std::string described =
      "/v1/volumes?dims=4,3,2&type=uint8&upload=" + raw.header("isomesh-upload");
  EXPECT_EQ(daemon_.send("POST", described).status, 201);
}

TEST_F(KeptTest, AKeptFolderHasEachOfItsVolumesRead) {
  const Answer first = daemon_.send("POST", "/v1/volumes?keep=true", folder_of_two());
  EXPECT_EQ(first.status, 207);
  const std::string again = "/v1/volumes?member=a.nii&upload=" + first.header("isomesh-upload");
  EXPECT_EQ(daemon_.send("POST", again + "&volume=0").status, 201);
  EXPECT_EQ(daemon_.send("POST", again + "&volume=1").status, 201);
}

TEST_F(KeptTest, AFolderStaysAfterItIsReadAsAWhole) {
  const Answer first = daemon_.send("POST", "/v1/volumes?keep=true", folder_of_two());
  const std::string again = "/v1/volumes?keep=true&upload=" + first.header("isomesh-upload");
  ASSERT_EQ(daemon_.send("POST", again).status, 207);
  const Answer chosen = daemon_.send("POST", again + "&member=a.nii&volume=0");
  EXPECT_EQ(chosen.status, 201) << chosen.body;
}

TEST_F(KeptTest, AFolderGoesWhenAllOfItIsRead) {
  const Answer first = daemon_.send("POST", "/v1/volumes?keep=true&member=none",
                                    folder_with("a.nrrd", nrrd(std::string(24, 'a'))));
  const std::string again = "/v1/volumes?upload=" + first.header("isomesh-upload");
  EXPECT_EQ(daemon_.send("POST", again + "&member=a.nrrd").status, 201);
  ASSERT_EQ(daemon_.send("POST", again).status, 207);
  EXPECT_TRUE(is_problem(daemon_.send("POST", again), ErrorCode::kGone));
}

TEST_F(KeptTest, AResumedUploadThatIsKeptAnswersEachChoice) {
  const std::string again = "/v1/volumes?upload=" + resumed("keep=true&volume=0", two_times());
  const Answer second = daemon_.send("POST", again + "&volume=1");
  ASSERT_EQ(second.status, 201) << second.body;
  const Answer first = daemon_.send("POST", again + "&volume=0");
  EXPECT_EQ(first.status, 200) << first.body;
  EXPECT_NE(volume_from_json(first.body).id, volume_from_json(second.body).id);
  EXPECT_EQ(daemon_.send("POST", again).body, first.body);
}

TEST_F(KeptTest, AResumedUploadAnswersOnlyTheOptionsThatItWasReadWith) {
  const std::string again = "/v1/volumes?upload=" + resumed("volume=0", two_times());
  const Answer first = daemon_.send("POST", again + "&volume=0");
  EXPECT_EQ(first.status, 200) << first.body;
  EXPECT_EQ(daemon_.send("POST", again).body, first.body);
  for (const char* other :
       {"&volume=1", "&volume=0&modality=ct", "&volume=0&nifti_form=qform",
        "&volume=0&accept=frame-of-reference", "&volume=0&spacing=1,1,1", "&masks=true"}) {
    EXPECT_TRUE(is_problem(daemon_.send("POST", again + other), ErrorCode::kGone)) << other;
  }
}

}  // namespace
}  // namespace isomesh::test
