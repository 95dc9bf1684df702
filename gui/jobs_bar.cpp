#include "gui/jobs_bar.h"

#include <QHBoxLayout>
#include <QStyle>

#include "cli/progress_display.h"

namespace fathom::gui {

namespace {

constexpr int kSteps = 1000;
constexpr double kEstimated = 0.02;  // of the work, from which on the time that is left is told

}  // namespace

JobsBar::JobsBar(Jobs& jobs, QWidget* parent)
    : QWidget(parent), jobs_(jobs), name_(new QLabel), bar_(new QProgressBar), cancel_(new QToolButton) {
  name_->setTextFormat(Qt::PlainText);
  bar_->setRange(0, kSteps);
  bar_->setFixedWidth(160);
  bar_->setMaximumHeight(fontMetrics().height() + 2);
  cancel_->setIcon(style()->standardIcon(QStyle::SP_DialogCancelButton));
  cancel_->setToolTip(tr("Stop this job"));
  cancel_->setAutoRaise(true);
  cancel_->setObjectName("cancelJob");
  auto* layout = new QHBoxLayout(this);
  layout->setContentsMargins(0, 0, 0, 0);
  layout->addWidget(name_);
  layout->addWidget(bar_);
  layout->addWidget(cancel_);
  connect(cancel_, &QToolButton::clicked, &jobs_, [this] {
    cancel_->setEnabled(false);
    jobs_.cancel();
  });
  connect(&jobs_, &Jobs::changed, this, &JobsBar::update);
  connect(&jobs_, &Jobs::progressed, this, &JobsBar::update);
  update();
}

void JobsBar::update() {
  setVisible(jobs_.busy());
  if (!jobs_.busy()) return;
  const bool fresh = jobs_.done() == 0;
  if (fresh) cancel_->setEnabled(true);
  const QString more = jobs_.waiting() > 0 ? tr(" (%n more)", nullptr, jobs_.waiting()) : QString();
  name_->setText(jobs_.name() + more);
  bar_->setValue(int(jobs_.done() * kSteps));
  if (jobs_.done() < kEstimated) return bar_->setFormat(QStringLiteral("%p %"));
  const double left = jobs_.seconds() / jobs_.done() * (1 - jobs_.done());
  bar_->setFormat(tr("%1 left").arg(QString::fromStdString(cli::describeTime(left))));
}

}  // namespace fathom::gui
