#include "server/http/requests/router.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace isomesh::http {
namespace {

using testing::ElementsAre;
using testing::Pair;

class RouterTest : public testing::Test {
 protected:
  RouterTest() {
    for (const char* pattern : {"/", "/v1/jobs", "/v1/jobs/{id}", "/v1/jobs/{id}/mesh.{format}",
                                "/v1/volumes/{id}/slice.png", "/assets/{file}"}) {
      router_.add("GET", pattern, handler_of([](const Request&, Response&) {}));
    }
    router_.add("DELETE", "/v1/jobs/{id}", handler_of([](const Request&, Response&) {}));
  }

  std::string pattern_of(const std::string& path) const {
    const Route* route = router_.find(path).first;
    return route == nullptr ? "none" : route->pattern();
  }

  Router router_;
};

TEST_F(RouterTest, FindsTheRouteOfAPath) {
  for (const std::string path : {"/", "/v1/jobs"}) EXPECT_EQ(pattern_of(path), path);
  EXPECT_EQ(pattern_of("/v1/jobs/01-aB"), "/v1/jobs/{id}");
  EXPECT_EQ(pattern_of("/v1/jobs/0/mesh.glb"), "/v1/jobs/{id}/mesh.{format}");
  EXPECT_EQ(pattern_of("/v1/volumes/0/slice.png"), "/v1/volumes/{id}/slice.png");
  EXPECT_EQ(pattern_of("/assets/index-1a_2b.js"), "/assets/{file}");
}

TEST_F(RouterTest, FindsNoneForOtherPaths) {
  for (const std::string path :
       {"", "*", "v1/jobs", "/v1", "/v1/jobs/", "/v1/jobs//", "//v1/jobs", "/V1/jobs",
        "/v1/jobs/a/b", "/v1/jobs/0/mesh.", "/v1/jobs/0/mesh", "/v1/jobs/0/grid.glb",
        "/v1/jobs//mesh.glb", "/v1/volumes/0/slice_png", "/assets/a b", "/assets/a\nb",
        "/assets/\xC3\xA4", "/assets/a%", "/v1/jobs/{id}/x"}) {
    EXPECT_EQ(pattern_of(path), "none") << path;
  }
  EXPECT_EQ(pattern_of("/v1/jobs/" + std::string(100, 'a')), "/v1/jobs/{id}");
  EXPECT_EQ(pattern_of("/v1/jobs/" + std::string(101, 'a')), "none");
  EXPECT_EQ(pattern_of(std::string("/assets/a\0b", 11)), "none");
}

TEST_F(RouterTest, GivesTheParameters) {
  EXPECT_THAT(router_.find("/v1/jobs/01/mesh.stl.gz").second,
              ElementsAre(Pair("id", "01"), Pair("format", "stl.gz")));
  EXPECT_THAT(router_.find("/v1/jobs").second, testing::IsEmpty());
}

TEST_F(RouterTest, KnowsTheMethodsOfAPath) {
  EXPECT_EQ(router_.find("/v1/jobs/0").first->methods(), "DELETE, GET");
  EXPECT_EQ(router_.routes().size(), 6U);
}

}  // namespace
}  // namespace isomesh::http
