#include "cli/denoise_budget.h"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <filesystem>
#include <set>

#include "base/error.h"
#include "deep/flatten.h"
#include "deep/io.h"
#include "flat/io.h"
#include "tests/reference/noisy_frame.h"
#include "tests/reference/run_fathom.h"
#include "tests/reference/temporary_folder.h"

namespace fathom {
namespace {

using cli::BudgetChoice;
using cli::DenoiseSetting;
using cli::SettingCost;
using cli::Workload;
using deep::Quality;
using reference::makeNoisyFrame;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

const DenoiseSetting kFast{Quality::Fast, true, "none"}, kBalanced{Quality::Balanced, true, "none"},
    kBest{Quality::Best, true, "none"}, kGuided{Quality::Fast, true, "oidn"};
const std::vector<SettingCost> kCosts = {
    {kFast, 1, 1, 0, 0.3}, {kBalanced, 2, 2, 0, 0.2}, {kBest, 10, 10, 0, 0.1}, {kGuided, 1, 1, 30, 0.05}};

DenoiseSetting chosen(double budget, double slowness = 1, const Workload& workload = {}) {
  return chooseSetting(kCosts, workload, budget, slowness).setting;
}

TEST(TimeBudget, TheLeastErrorThatFits) {
  EXPECT_EQ(chosen(3), kFast);
  EXPECT_EQ(chosen(4), kBalanced) << "exactly";
  EXPECT_EQ(chosen(19.9), kBalanced);
  EXPECT_EQ(chosen(20), kBest);
  EXPECT_EQ(chosen(1000), kGuided);
}

TEST(TimeBudget, ASlowerMachineOrALargerFrameDoesLess) {
  EXPECT_EQ(chosen(20, 2), kBalanced);
  EXPECT_EQ(chosen(12, 0.5), kBest);
  EXPECT_EQ(chosen(20, 0.5, {.megapixels = 2.1}), kBalanced);
  EXPECT_EQ(chosen(20, 1, {.binsPerPixel = 2}), kBalanced);
}

TEST(TimeBudget, NoneThatFitsIsTheQuickest) {
  const BudgetChoice choice = chooseSetting(kCosts, {}, 0.5, 1);
  EXPECT_EQ(choice.setting, kFast);
  EXPECT_FALSE(choice.fits);
  EXPECT_EQ(choice.seconds, 2);
  EXPECT_TRUE(chooseSetting(kCosts, {}, 2, 1).fits);
}

TEST(TimeBudget, OfEqualErrorsTheQuicker) {
  const std::vector<SettingCost> costs = {{kBest, 3, 0, 0, 0.1}, {kFast, 1, 0, 0, 0.1}};
  EXPECT_EQ(chooseSetting(costs, {}, 10, 1).setting, kFast);
}

TEST(TimeBudget, AnUnusableCalibrationStillChooses) {
  EXPECT_EQ(chosen(10, std::numeric_limits<double>::infinity()), kFast);
  EXPECT_FALSE(chooseSetting(kCosts, {}, 10, std::numeric_limits<double>::quiet_NaN()).fits);
}

TEST(TimeBudget, CostsAreLinearInPixelsAndBins) {
  const SettingCost cost{kFast, 3, 5, 7, 0.5};
  EXPECT_DOUBLE_EQ(expectedSeconds(cost, {.megapixels = 2, .binsPerPixel = 1.5}, 1), 2 * (3 + 5 * 1.5 + 7));
  EXPECT_DOUBLE_EQ(expectedSeconds(cost, {}, 4), 4 * (3 + 5 + 7));
  EXPECT_DOUBLE_EQ(expectedSeconds(cost, {.runs = 3}, 1), 3 * (3 + 5 + 7));
  const SettingCost flat{{Quality::Fast, false, "nlm"}, 3, 5, 7, 0.5};
  EXPECT_DOUBLE_EQ(expectedSeconds(flat, {.runs = 3}, 1), 3 + 5 + 7) << "tells its errors by itself";
  EXPECT_DOUBLE_EQ(expectedSeconds(flat, {.runs = 3, .flatRuns = 3}, 1), 3 * (3 + 5 + 7));
  const double one = expectedSeconds(cost, {.components = false}, 1);
  EXPECT_LT(one, 15);
  EXPECT_GT(one, 7) << "the network sees no components";
}

TEST(TimeBudget, TheNetworkCostsByItsLightsAndItsSize) {
  const SettingCost cost{{Quality::Fast, false, "neural", 2}, 0, 0, 3, 0.5};
  const Workload one{.megapixels = 2, .components = false};
  EXPECT_DOUBLE_EQ(expectedSeconds(cost, one, 1), 2 * 3);
  Workload other = one;
  other.components = true;
  EXPECT_DOUBLE_EQ(expectedSeconds(cost, other, 1), 2 * 2 * 3);
  other.networkWork = 3.5;
  EXPECT_DOUBLE_EQ(expectedSeconds(cost, other, 1), 2 * 2 * 3 * 3.5);
  other.bfloat16 = false;
  EXPECT_GT(expectedSeconds(cost, other, 1), 2 * 2 * 3 * 3.5 * 1.5);
  const SettingCost full{{Quality::Balanced, false, "neural", 2}, 0, 0, 3, 0.5};
  EXPECT_DOUBLE_EQ(expectedSeconds(full, other, 1), 2 * 2 * 3 * 3.5) << "float32 anyway";
}

TEST(TimeBudget, TheMeasurementHasEverySetting) {
  const std::vector<std::string> guides = {"none", "nlm", "neural", "oidn"}, bases = {"nlm", "neural", "oidn"};
  std::set<std::string> names;
  for (const bool isDeep : {true, false})
    for (const SettingCost& cost : cli::costsOf(isDeep, isDeep ? guides : bases)) {
      names.insert(describeSetting(cost.setting));
      EXPECT_GT(expectedSeconds(cost, {}, 1), 0) << describeSetting(cost.setting);
      EXPECT_TRUE(cost.error > 0 && cost.error < 1) << describeSetting(cost.setting);
    }
  EXPECT_EQ(names.size(), 12 + 3 + 2 + 6);
  EXPECT_EQ(names.size(), cli::measuredCosts().size());
  EXPECT_GT(cli::measuredCalibration(), 0);
}

TEST(TimeBudget, AGuideOfAFileCostsNothing) {
  const std::vector<std::string> file = {cli::kGuideFile}, none = {"none"};
  const auto guided = cli::costsOf(true, file), alone = cli::costsOf(true, none);
  ASSERT_EQ(guided.size(), 3);
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(guided[i].setting.with, cli::kGuideFile);
    EXPECT_EQ(expectedSeconds(guided[i], {}, 1), expectedSeconds(alone[i], {}, 1));
  }
}

TEST(TimeBudget, SettingsAreOptionsAndReadBack) {
  EXPECT_EQ(cli::describeSetting({Quality::Best, true, "nlm"}), "--quality best --flat-guide nlm");
  EXPECT_EQ(cli::describeSetting({Quality::Fast, false, "oidn"}), "--quality fast --method oidn");
  EXPECT_EQ(cli::describeSetting({Quality::Fast, false, "neural", 4}), "--quality fast --method neural --components 4");
  for (const SettingCost& cost : cli::measuredCosts())
    EXPECT_EQ(cli::parseSetting(describeSetting(cost.setting)), cost.setting);
  for (const char* text : {"", "--quality best", "--quality best --flat-guide nlm ", "--quality worst --method nlm"})
    EXPECT_FALSE(cli::parseSetting(text)) << text;
}

// A sequence's plan and request, on no machine in particular.
struct Planned {
  cli::DenoiseRequest request;
  cli::SequencePlan plan;

  explicit Planned(bool isDeep = true) {
    request.timeBudget = 1e6;
    request.base.oidnLibrary = "/nowhere";
    request.anyBase = true;
    plan.deep = isDeep;
    plan.pixels = 1'000'000;
    plan.samples = 2'000'000;
    plan.denoise.inputs.halves = plan.denoise.inputs.components = true;
  }
  std::string choice(const std::vector<std::string>& outputs = {}) const {
    return describeSetting(planBudget(request, plan, outputs, [] { return 1.0; }).setting);
  }
};

TEST(DenoiseBudget, WhatTheOptionsLeaveOpen) {
  Planned planned;
  EXPECT_EQ(planned.choice(), "--quality best --flat-guide neural") << "Open Image Denoise is not installed";
  planned.request.base.model = "nowhere.safetensors";
  EXPECT_EQ(planned.choice(), "--quality best --flat-guide nlm") << "neither is the network";
  planned.request.base.model.clear();
  planned.request.memory = 400'000'000;
  EXPECT_EQ(planned.choice(), "--quality best --flat-guide nlm") << "a whole frame does not fit";
  planned.request.memory = size_t(8) << 30;
  planned.request.guide = "none";
  EXPECT_EQ(planned.choice(), "--quality best --flat-guide none");
  planned.request.guide = "guide.exr";
  EXPECT_EQ(planned.choice(), "--quality best --flat-guide FILE");
  planned.request.guide = "auto";
  planned.request.base.name = "oidn";
  EXPECT_THAT(planned.choice(), HasSubstr("--flat-guide oidn"));
  planned = Planned();
  planned.plan.denoise.inputs.halves = false;
  EXPECT_EQ(planned.choice(), "--quality best --flat-guide none") << "a frame that says nothing of its noise";
}

TEST(DenoiseBudget, FlatFramesKeepTheBaseThatIsNamed) {
  Planned planned(false);
  EXPECT_EQ(planned.choice(), "--quality best --method nlm");
  planned.request.base.name = "oidn";
  planned.request.anyBase = false;
  EXPECT_THAT(planned.choice(), HasSubstr("--method oidn"));
}

TEST(DenoiseBudget, TheNetworkIsChosenFromLikeTheOthers) {
  Planned planned(false);
  planned.request.timeBudget = 1e-6;
  EXPECT_EQ(planned.choice(), "--quality fast --method neural --components 1") << "the quickest";
  planned.request.memory = 100'000'000;
  EXPECT_EQ(planned.choice(), "--quality fast --method nlm") << "which needs no whole frames";
  planned.request.memory = size_t(8) << 30;
  planned.request.base.model = "/nowhere.safetensors";
  EXPECT_EQ(planned.choice(), "--quality fast --method nlm") << "no model that could be read";
  planned.request.anyBase = false;
  planned.request.base.name = "neural";
  EXPECT_THROW(planned.choice(), Error);
  planned.request.base.model.clear();
  planned.request.timeBudget = 1000;
  EXPECT_THAT(planned.choice(), HasSubstr("--method neural --components 4"));
  planned.request.base.components = 2;
  EXPECT_THAT(planned.choice(), HasSubstr("--method neural --components 2"));
}

// What estimates say decides among those that fit, and nothing else.
TEST(DenoiseBudget, EstimatedErrorsDecideAmongTheBasesThatFit) {
  Planned planned(false);
  std::set<std::string> asked;
  const auto choice = [&](double budget, const std::string& best) {
    planned.request.timeBudget = budget;
    asked.clear();
    const cli::ErrorOf errorOf = [&](const DenoiseSetting& setting) {
      asked.insert(setting.with);
      return setting.with == best ? 1.0 : 2.0;
    };
    return describeSetting(planBudget(
                               planned.request, planned.plan, {}, [] { return 1.0; }, errorOf)
                               .setting);
  };
  EXPECT_EQ(choice(1000, "neural"), "--quality fast --method neural --components 4") << "of equals the quicker";
  EXPECT_EQ(choice(1000, "nlm"), "--quality best --method nlm");
  EXPECT_EQ(asked, (std::set<std::string>{"neural", "nlm"}));
  EXPECT_THAT(choice(0.8, "nlm"), HasSubstr("--method neural")) << "the other takes longer";
  EXPECT_TRUE(asked.empty()) << "one is left";
}

TEST(DenoiseBudget, ASettingIsARequestAndNothingElse) {
  cli::DenoiseRequest request;
  request.guide = "guide.exr";
  EXPECT_EQ(cli::withSetting(request, {Quality::Best, true, cli::kGuideFile}).guide, "guide.exr");
  EXPECT_EQ(cli::withSetting(request, {Quality::Best, true, "nlm"}).guide, "nlm");
  EXPECT_EQ(cli::withSetting(request, {Quality::Best, true, "nlm"}).params.quality, Quality::Best);
  EXPECT_EQ(cli::withSetting(request, {Quality::Fast, false, "oidn"}).base.name, "oidn");
  EXPECT_EQ(cli::withSetting(request, {Quality::Fast, false, "neural", 4}).base.components, 4);
}

// A folder with frames in.0001.exr to in.0003.exr.
class DenoiseWithBudget : public testing::Test {
 protected:
  DenoiseWithBudget() {
    for (unsigned i = 1; i <= 3; ++i) deep::write(folder_ / fmt::format("in.{:04}.exr", i), makeNoisyFrame(24, 20, i));
  }
  Ran run(const std::string& arguments) const {
    return runFathom("denoise --oidn-library /nowhere " + arguments,
                     "cd '" + folder_.path() + "'; FATHOM_MODELS=/nowhere");
  }
  Ran runAll(const std::string& options) const { return run("in.####.exr -o out.####.exr " + options); }
  cli::BudgetRecord record(const std::string& name) const {
    return cli::readRecord(folder_ / name).value_or(cli::BudgetRecord{});
  }
  void remove(const std::string& name) const { std::filesystem::remove(folder_ / name); }

  TemporaryFolder folder_;
};

TEST_F(DenoiseWithBudget, TheChoiceIsRecordedAndIsWhatItsOptionsMake) {
  const Ran outcome = runAll("--time-budget 1000 --flat flat.####.exr");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("in.0001.exr: 1000 s a frame allow --quality "));
  const std::string setting = record("out.0001.exr").setting;
  EXPECT_THAT(outcome.err, HasSubstr(setting));
  EXPECT_EQ(record("out.0001.exr").budget, "1000 s");
  for (const char* name : {"out.0003.exr", "flat.0001.exr"}) EXPECT_EQ(record(name), record("out.0001.exr")) << name;
  const Ran again = runAll(setting + " --flat flat.####.exr");
  EXPECT_EQ(again.status, 0) << again.err;
  EXPECT_THAT(again.out, AllOf(HasSubstr("out.0001.exr: done before"), HasSubstr("out.0003.exr: done before")));
}

TEST_F(DenoiseWithBudget, ALaterRunTakesWhatIsRecorded) {
  ASSERT_EQ(runAll("--time-budget 1000 --frames 2").status, 0);
  const std::string setting = record("out.0002.exr").setting;
  const Ran outcome = runAll("--time-budget 0.000001");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("out.0002.exr: made with " + setting + " for 1000 s a frame"));
  EXPECT_THAT(outcome.out, HasSubstr("out.0002.exr: done before"));
  EXPECT_EQ(record("out.0001.exr").setting, setting);
  // What it recorded is enough for the next one.
  remove("out.0002.exr");
  ASSERT_EQ(runAll("--time-budget 5").status, 0);
  EXPECT_EQ(record("out.0002.exr").setting, setting);
}

TEST_F(DenoiseWithBudget, TooLittleTimeIsTheQuickestAndALine) {
  const Ran outcome = runAll("--time-budget 0.000001 --frames 1 --flat-guide none");
  ASSERT_EQ(outcome.status, 0);
  EXPECT_THAT(outcome.err, HasSubstr("1e-06 s a frame are too few; the quickest setting, --quality fast"));
  EXPECT_EQ(record("out.0001.exr").setting, "--quality fast --flat-guide none");
}

TEST_F(DenoiseWithBudget, OverwritingChoosesAnewForAnotherBudget) {
  const std::string few = "--time-budget 0.000001 --flat-guide none", many = "--time-budget 1000 --flat-guide none";
  ASSERT_EQ(runAll(few).status, 0);
  ASSERT_EQ(runAll(many + " --overwrite --frames 2").status, 0);
  EXPECT_EQ(record("out.0002.exr").setting, "--quality best --flat-guide none");
  const Ran outcome = runAll(many + " --overwrite");
  EXPECT_THAT(outcome.err, HasSubstr("out.0002.exr: made with --quality best"));
  EXPECT_THAT(outcome.out, HasSubstr("out.0002.exr: done before"));
  EXPECT_EQ(record("out.0001.exr"), record("out.0002.exr"));
}

TEST_F(DenoiseWithBudget, OptionsThatContradictTheRecordAreALine) {
  ASSERT_EQ(runAll("--time-budget 1000 --flat-guide none --frames 1").status, 0);
  const Ran outcome = runAll("--time-budget 1000 --flat-guide nlm");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("out.0001.exr: expected a setting that these options allow"));
  EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  EXPECT_EQ(runAll("--time-budget 1000 --flat-guide nlm --overwrite").status, 0);
}

TEST_F(DenoiseWithBudget, OutputsOfOthersAreRefusedAsEver) {
  ASSERT_EQ(runAll("--quality fast --frames 1 --flat-guide none").status, 0);
  EXPECT_EQ(record("out.0001.exr"), cli::BudgetRecord{});
  const Ran outcome = runAll("--time-budget 1000");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("out.0001.exr: expected nothing there"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "out.0002.exr"));
}

TEST_F(DenoiseWithBudget, FlatFramesSayItToo) {
  flat::write(folder_ / "flat.exr", deep::flatten(makeNoisyFrame(24, 20, 1)));
  ASSERT_EQ(run("flat.exr -o out.exr --time-budget 0.000001").status, 0);
  EXPECT_EQ(record("out.exr"), (cli::BudgetRecord{"1e-06 s", "--quality fast --method nlm"}));
  EXPECT_THAT(run("flat.exr -o out.exr --time-budget 1000").out, HasSubstr("done before"));
}

TEST_F(DenoiseWithBudget, AnInputsRecordIsNotPassedOn) {
  deep::DeepImage frame = makeNoisyFrame(24, 20, 1);
  frame.attributes.set(cli::kMadeBy, std::string("fathom of another day"));
  frame.attributes.set(cli::kBudget, std::string("7 s"));
  frame.attributes.set(cli::kSetting, std::string("--quality best --flat-guide none"));
  deep::write(folder_ / "in.exr", frame);
  EXPECT_EQ(record("in.exr").budget, "7 s");
  ASSERT_EQ(run("in.exr -o out.exr --flat flat.exr --quality fast").status, 0);
  for (const char* name : {"out.exr", "flat.exr"}) EXPECT_EQ(record(name), cli::BudgetRecord{}) << name;
}

TEST_F(DenoiseWithBudget, UsageErrorsExitWith2) {
  for (const char* options : {"--time-budget 5 --quality fast", "--time-budget 0", "--time-budget -1",
                              "--time-budget nan", "--time-budget inf", "--time-budget soon", "--time-budget"}) {
    const Ran outcome = runAll(options);
    EXPECT_EQ(outcome.status, 2) << options << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr("--time-budget")) << options;
  }
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out.0001.exr"));
}

}  // namespace
}  // namespace fathom
