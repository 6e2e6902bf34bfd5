#include "libeditnerf/poses/colmap_runner.h"

#include <set>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"
#include "tests/imaging/messages.h"
#include "tests/poses/fake_colmap.h"

using namespace editnerf;

TEST_CASE("only options that the installed COLMAP knows are given") {
  const ScratchFolder folder;
  ColmapOptions options;
  options.threads = 3;
  const auto calls = [&](const std::string& known) {
    options.program = WriteFakeColmap(folder.path(), "database_path image_path output_path match_list_path " + known);
    std::filesystem::remove(folder / "calls.txt");
    RunColmap(folder / "images", {"a.png", "b.png"}, folder / "work", options);
    return ReadText(folder / "calls.txt");
  };
  const std::string old_names = calls("SiftExtraction.use_gpu SiftMatching.num_threads ImageReader.single_camera");
  CHECK_THAT(old_names, HasText("offscreen feature_extractor --database_path"));
  CHECK_THAT(old_names, HasText("--SiftExtraction.use_gpu 0"));
  CHECK_THAT(old_names, HasText("--SiftMatching.num_threads 3"));
  CHECK_THAT(old_names, HasText("--ImageReader.single_camera 1"));
  CHECK_THAT(old_names, !HasText("FeatureExtraction"));
  CHECK_THAT(old_names, !HasText("camera_model"));
  const std::string new_names = calls("FeatureExtraction.use_gpu FeatureMatching.use_gpu");
  CHECK_THAT(new_names, HasText("--FeatureExtraction.use_gpu 0"));
  CHECK_THAT(new_names, HasText("--FeatureMatching.use_gpu 0"));
  CHECK_THAT(new_names, !HasText("Sift"));
  CHECK(ReadText(folder / "work/pairs.txt") == "a.png b.png\n");
}

TEST_CASE("the largest of COLMAP's models comes first") {
  const ScratchFolder folder;
  WriteColmapBinary(ArcFixture(3), folder.path() / "models" / "0");
  WriteColmapBinary(ArcFixture(5), folder.path() / "models" / "1");
  ColmapOptions options;
  options.program = WriteFakeColmap(folder.path(), "database_path image_path output_path");
  const ColmapResult result = RunColmap(folder / "images", {"a.png", "b.png"}, folder / "work", options);
  REQUIRE(result.models.size() == 2);
  CHECK(result.models[0].filename() == "1");
  CHECK(result.seconds.size() == 3);
}

TEST_CASE("COLMAP being absent or failing is told with advice") {
  const ScratchFolder folder;
  ColmapOptions options;
  const auto error = [&] {
    return MessageOf<DataError>([&] { RunColmap(folder / "images", {"a.png", "b.png"}, folder / "work", options); });
  };
  options.program = "editnerf-no-such-colmap";
  CHECK(error() ==
        "editnerf-no-such-colmap: cannot be started: No such file or directory; COLMAP finds the camera poses: install "
        "it "
        "(apt-get install colmap), or give a solved model with --colmap-model");
  options.program = WriteFakeColmap(folder.path(), "database_path", "echo first; echo 'database is locked'; exit 7");
  CHECK_THAT(error(),
             HasText("COLMAP's feature extraction failed with exit code 7: 'database is locked'; its output is in"));
}

TEST_CASE("every pair is matched in short sequences, neighbours and loops in long ones") {
  ColmapOptions options;
  CHECK(ImagePairs(1, options).empty());
  CHECK(ImagePairs(20, options).size() == 190);
  CHECK(ImagePairs(40, options).size() == 40 * 39 / 2);
  const auto list = ImagePairs(1000, options);
  const std::set<std::pair<int64_t, int64_t>> pairs(list.begin(), list.end());
  CHECK(pairs.size() < 1000 * 25);
  for (int64_t i = 0; i + 10 < 1000; ++i) CHECK(pairs.count({i, i + 10}) == 1);
  CHECK(pairs.count({0, 950}) == 1);  // both ends
  CHECK(pairs.count({3, 3 + 80}) == 1);
  for (const auto& [i, j] : pairs) CHECK((0 <= i && i < j && j < 1000));
}
