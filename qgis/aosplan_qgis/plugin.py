"""Register the provider with QGIS, and list its algorithms."""

from qgis.core import QgsApplication, QgsProcessingProvider

from .plan_algorithm import PlanAlgorithm


class AosplanProvider(QgsProcessingProvider):
    """The group "aosplan" of the Processing toolbox."""

    def id(self):
        return "aosplan"

    def name(self):
        return "aosplan"

    def loadAlgorithms(self):
        self.addAlgorithm(PlanAlgorithm())


class AosplanPlugin:
    """Adds the provider when the plugin is enabled and removes it afterwards."""

    def __init__(self):
        self.provider = None

    def initProcessing(self):  # qgis_process calls this method alone
        self.provider = AosplanProvider()
        QgsApplication.processingRegistry().addProvider(self.provider)

    def initGui(self):
        self.initProcessing()

    def unload(self):
        QgsApplication.processingRegistry().removeProvider(self.provider)
